//! The board's FRAM (Cypress FM25V02 or FM25V02A) with its faults.

use rigless::{
    chip::{
        Timeline,
        fram::{Fm25v02, POWER_UP, SIZE},
        spi::Peer,
    },
    snapshot::Store,
    time::{EventId, VirtualNanos},
};

use crate::parts::MemoryMake;

/// Two address bytes follow.
const WRITE: u32 = 0x02;
const READ: u32 = 0x03;
const READ_ID: u32 = 0x9f;

#[derive(Debug)]
pub struct MemoryChip {
    chip: Fm25v02,
    make: MemoryMake,
    /// Bytes of the current command, and its opcode.
    command: (u32, u32),
    /// Remaining answers with a flipped bit: identification, reads.
    spoilt: (u32, u32),
    written: u64,
    /// Write count at which the supply fails.
    fails_at: Option<u64>,
    failed: bool,
}

impl MemoryChip {
    pub fn new(make: MemoryMake) -> Self {
        Self {
            chip: Fm25v02::new(),
            make,
            command: (0, 0),
            spoilt: (0, 0),
            written: 0,
            fails_at: None,
            failed: false,
        }
    }

    /// Replaces the chip and keeps the contents; or removes it.
    pub fn set_make(&mut self, make: MemoryMake) {
        self.make = make;
    }

    /// Flips one bit in each of the next `names` identification answers and `reads` reads.
    pub fn spoil_answers(&mut self, names: u32, reads: u32) {
        self.spoilt = (names, reads);
    }

    pub fn contents(&self) -> &[u8] {
        self.chip.stored()
    }

    pub fn written(&self) -> u64 {
        self.written
    }

    /// The last byte is still stored.
    pub fn fail_after(&mut self, bytes: u64) {
        self.fails_at = Some(self.written + bytes);
    }

    pub fn keep_supply(&mut self) {
        self.fails_at = None;
    }

    /// Whether the supply has failed since the last call.
    pub fn take_failure(&mut self) -> bool {
        self.failed && self.fails_at.take().is_some()
    }

    /// Noise on select, clock and data: another byte at a random address.
    pub fn disturb(&mut self, noise: u64) {
        let mut contents = self.chip.stored().to_vec();
        let at = noise as usize % contents.len().max(1);
        if let Some(byte) = contents.get_mut(at) {
            *byte = (noise >> 32) as u8;
        }
        self.rebuild(&contents, VirtualNanos(0));
    }

    pub fn set_contents(&mut self, contents: &[u8; SIZE]) {
        self.rebuild(contents, VirtualNanos(0));
    }

    pub fn power_up(&mut self, at: VirtualNanos) {
        let contents = self.chip.stored().to_vec();
        self.rebuild(&contents, VirtualNanos(at.0 + POWER_UP.0));
        self.failed = false;
        self.fails_at = None;
    }

    /// Flips a bit of a spoilt answer: in the first byte of a read, or in the manufacturer's byte of the identification.
    fn spoil(&mut self, answer: u32) -> u32 {
        let (count, opcode) = self.command;
        let (spoilt, left) = match opcode {
            READ_ID => (8, &mut self.spoilt.0),
            READ => (4, &mut self.spoilt.1),
            _ => return answer,
        };
        if count != spoilt || *left == 0 {
            return answer;
        }
        *left -= 1;
        // Another bit each time.
        answer ^ 1 << (*left % 8)
    }

    /// The emulator's chip has no method for this, so a new one is created.
    fn rebuild(&mut self, contents: &[u8], ready_at: VirtualNanos) {
        let described = serde_json::to_value(Fm25v02::new()).and_then(|mut chip| {
            chip["memory"] = contents.into();
            chip["ready_at"] = serde_json::to_value(ready_at)?;
            serde_json::from_value(chip)
        });
        match described {
            Ok(chip) => self.chip = chip,
            Err(error) => unreachable!("the chip's own description does not fit it: {error}"),
        }
    }
}

impl Peer for MemoryChip {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let released = (1 << bits) - 1;
        if self.failed || self.make == MemoryMake::None {
            return released;
        }
        let (count, opcode) = &mut self.command;
        if *count == 0 {
            *opcode = mosi;
        }
        *count += 1;
        if *opcode == WRITE && *count > 3 {
            self.written += 1;
            self.failed = self.fails_at.is_some_and(|at| self.written >= at);
        }
        let altered = match (*opcode, *count) {
            (READ_ID, 2..=10) => Some(u32::from(self.make.name()[*count as usize - 2])),
            _ => None,
        };
        let answer = self.chip.transfer(mosi, bits, context);
        self.spoil(altered.unwrap_or(answer))
    }

    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.command = (0, 0);
        self.chip.select(context);
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.chip.deselect(context);
    }

    fn on_event(&mut self, event: EventId, context: &mut Timeline<'_, '_>) {
        self.chip.on_event(event, context);
    }

    fn restarted(&mut self, context: &mut Timeline<'_, '_>) {
        self.chip.restarted(context);
    }
}

impl Store for MemoryChip {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spoils_reads_of_any_length() {
        let mut chip = MemoryChip::new(MemoryMake::Fm25v02a);
        chip.spoil_answers(1, 2);
        let mut answer = |opcode, bytes: u32| {
            let spoilt = (1..=bytes).filter(|count| {
                chip.command = (*count, opcode);
                chip.spoil(0xa5) != 0xa5
            });
            spoilt.count()
        };
        // Opcode, two bytes of address, one byte of data.
        assert_eq!([(); 3].map(|()| answer(READ, 4)), [1, 1, 0]);
        assert_eq!([(); 2].map(|()| answer(READ_ID, 10)), [1, 0]);
    }

    #[test]
    fn contents_survive_a_power_loss() {
        let mut chip = MemoryChip::new(MemoryMake::Fm25v02a);
        let mut contents = [0; SIZE];
        contents[77] = 0xa5;
        chip.set_contents(&contents);
        chip.power_up(VirtualNanos(1_000_000_000));
        assert_eq!(chip.contents(), contents);
    }
}
