//! Fetch delays: flash wait states and the accelerator (RM0090, section 3.5.2).
//!
//! The flash delivers 16 bytes after its wait states. Buffers: the current line, 64 lines of instruction
//! cache, 8 of data cache, prefetch of the next line. Replaces the oldest line (unpublished).

/// Bytes per line; lines of the instruction and data cache.
const LINE: u64 = 16;
const INSTRUCTION_LINES: usize = 64;
const DATA_LINES: usize = 8;
const PREFETCH: u64 = 1 << 8;
const INSTRUCTION_CACHE: u64 = 1 << 9;
const DATA_CACHE: u64 = 1 << 10;

#[derive(Debug, Default)]
struct Lines(Vec<u64>);

impl Lines {
    fn take(&mut self, line: u64, most: usize) -> bool {
        let found = self.0.iter().position(|kept| *kept == line);
        if let Some(at) = found {
            self.0.remove(at);
        } else if self.0.len() >= most {
            self.0.remove(0);
        }
        self.0.push(line);
        found.is_some()
    }
}

#[derive(Debug, Default)]
pub(super) struct FlashInterface {
    acr: u64,
    instructions: Lines,
    data: Lines,
    current: u64,
    /// Cycles spent in this line, available to the prefetch.
    spent: u64,
}

impl FlashInterface {
    pub(super) fn set(&mut self, acr: u64) {
        *self = Self { acr, ..Self::default() };
    }

    const fn wait_states(&self) -> u64 {
        self.acr & 0xf
    }

    /// Wait cycles for an instruction at `address` that takes `cycles`.
    pub(super) fn fetch(&mut self, address: u64, bytes: u64, cycles: u64) -> u64 {
        let mut waits = 0;
        for line in address / LINE..=(address + bytes - 1) / LINE {
            if line != self.current {
                waits += self.enter(line);
            }
        }
        self.spent += cycles;
        waits
    }

    fn enter(&mut self, line: u64) -> u64 {
        let follows = line == self.current + 1;
        let had = std::mem::take(&mut self.spent);
        self.current = line;
        if self.acr & INSTRUCTION_CACHE != 0 && self.instructions.take(line, INSTRUCTION_LINES) {
            return 0;
        }
        let ahead = if follows && self.acr & PREFETCH != 0 { had } else { 0 };
        self.wait_states().saturating_sub(ahead)
    }

    pub(super) fn read(&mut self, address: u64) -> u64 {
        let kept = self.acr & DATA_CACHE != 0 && self.data.take(address / LINE, DATA_LINES);
        if kept { 0 } else { self.wait_states() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight_on(acr: u64, rounds: u64) -> u64 {
        let mut flash = FlashInterface::default();
        flash.set(acr);
        let once = |flash: &mut FlashInterface| (0..64).map(|i| flash.fetch(0x0800_0000 + 2 * i, 2, 1)).sum();
        (0..rounds).map(|_| once(&mut flash)).last().unwrap_or(0)
    }

    #[test]
    fn a_cached_loop_has_no_wait_cycles() {
        // 64 short instructions are 8 lines.
        assert_eq!(straight_on(0x005, 2), 8 * 5, "five wait states a line");
        assert_eq!(straight_on(0x105, 2), 5, "a line lasts longer than the prefetch of the next one");
        assert_eq!(straight_on(0x705, 1), 5, "the first line");
        assert_eq!(straight_on(0x705, 2), 0, "all of it is kept");
    }

    #[test]
    fn caches_constants() {
        let mut flash = FlashInterface::default();
        flash.set(0x705);
        assert_eq!([0, 4, 16, 0].map(|at| flash.read(0x0800_0100 + at)), [5, 0, 5, 0]);
        flash.set(0x305);
        assert_eq!([0, 0].map(|at| flash.read(0x0800_0100 + at)), [5, 5]);
    }
}
