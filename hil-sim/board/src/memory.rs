//! The board's FRAM, Cypress FM25V02 or FM25V02A (the emulator's model with the name of either), and what can happen to such
//! a chip: its supply fails in the middle of a write, a bit flips in it or on the bus, somebody solders in a new one or none.

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

/// Opcode of a write; two bytes of address follow it.
const WRITE: u32 = 0x02;
const READ: u32 = 0x03;
/// Opcode of the question for its name.
const READ_ID: u32 = 0x9f;

/// The chip behind its select.
#[derive(Debug)]
pub struct MemoryChip {
    chip: Fm25v02,
    make: MemoryMake,
    /// Bytes of the command under way, and its opcode.
    command: (u32, u32),
    /// A bit of each of the next so many answers is flipped on the bus: of its name, of what it holds.
    spoilt: (u32, u32),
    written: u64,
    /// The supply fails when so many bytes have been written.
    fails_at: Option<u64>,
    failed: bool,
}

impl MemoryChip {
    /// A new chip: all zero.
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

    /// Another chip is soldered in, with the same contents; or none.
    pub fn set_make(&mut self, make: MemoryMake) {
        self.make = make;
    }

    /// Flips a bit on the bus in each of the next so many answers to the question for its name, and in so many reads.
    pub fn spoil_answers(&mut self, names: u32, reads: u32) {
        self.spoilt = (names, reads);
    }

    pub fn contents(&self) -> &[u8] {
        self.chip.stored()
    }

    /// Bytes written since power-on of the rig.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Lets the supply fail when this many more bytes have been written: the last of them still lands.
    pub fn fail_after(&mut self, bytes: u64) {
        self.fails_at = Some(self.written + bytes);
    }

    /// The supply does not fail after all.
    pub fn keep_supply(&mut self) {
        self.fails_at = None;
    }

    /// Whether the supply has failed as [`MemoryChip::fail_after`] asked; said once.
    pub fn take_failure(&mut self) -> bool {
        self.failed && self.fails_at.take().is_some()
    }

    /// Puts these contents into the chip.
    pub fn set_contents(&mut self, contents: &[u8; SIZE]) {
        self.rebuild(contents, VirtualNanos(0));
    }

    /// The supply has come back.
    pub fn power_up(&mut self, at: VirtualNanos) {
        let contents = self.chip.stored().to_vec();
        self.rebuild(&contents, VirtualNanos(at.0 + POWER_UP.0));
        self.failed = false;
        self.fails_at = None;
    }

    /// The emulator's chip has no door for this, so a new one is made from its description.
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
        let told = match (*opcode, *count) {
            (READ_ID, 2..=10) => Some(u32::from(self.make.name()[*count as usize - 2])),
            _ => None,
        };
        let answer = self.chip.transfer(mosi, bits, context);
        let answer = told.unwrap_or(answer);
        let left = match *opcode {
            READ_ID => &mut self.spoilt.0,
            READ => &mut self.spoilt.1,
            _ => return answer,
        };
        // Somewhere in what comes back, behind opcode and address, and each time another bit.
        if *count == 8 && *left > 0 {
            *left -= 1;
            return answer ^ 1 << (*left % 8);
        }
        answer
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
    fn contents_can_be_put_in_and_survive_a_loss_of_power() {
        let mut chip = MemoryChip::new(MemoryMake::Fm25v02a);
        let mut contents = [0; SIZE];
        contents[77] = 0xa5;
        chip.set_contents(&contents);
        chip.power_up(VirtualNanos(1_000_000_000));
        assert_eq!(chip.contents(), contents);
    }
}
