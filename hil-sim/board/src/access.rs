//! Access to a running rig between two instructions: buttons, faults, power and chip memory.

use rigless::{
    device::Level,
    emulator::{Host, Memory, Stop},
    mcu::Operate,
    session::Session,
    soc::Width,
};

use crate::{
    board::{Chip, RAM, RigBoard, SpiChip, pins},
    chips::{SharedPlant, with_plant},
    faults::Lines,
    parts::{MemoryMake, Parts},
    plant::{Noise, Plant, StageName},
    serial::Line,
    wiring::Wiring,
};

/// Only the brown-out reset detects this dip: below the specified range, above the power-down reset (1.7 V).
const DIP_MV: u32 = 2_000;
/// Pattern with which cortex-m-rt paints the stack.
const STACK_PAINT: u64 = 0xcccc_cccc;
/// First address and length of the firmware's stack (see its `memory.x`).
pub const STACK: (u64, u64) = (0x2000_0000, 128 << 10);
/// RAM that the firmware does not use; its variables end well below.
const FREE_RAM: u64 = 0x2002_f000;

/// A rig paused between two instructions.
pub struct RigAccess<'a, 'h> {
    pub(crate) session: &'a mut Session<RigBoard>,
    pub(crate) host: &'a mut (dyn Host + 'h),
    pub(crate) stop: Stop,
    pub(crate) plant: &'a SharedPlant,
    pub(crate) wiring: &'a mut Wiring,
    pub(crate) line: &'a Line,
    pub(crate) lines: &'a mut Lines,
    pub(crate) parts: &'a Parts,
}

impl RigAccess<'_, '_> {
    pub fn now_ns(&self) -> u64 {
        self.stop.at.0
    }

    pub fn plant<T>(&mut self, work: impl FnOnce(&mut Plant) -> T) -> T {
        with_plant(self.plant, work)
    }

    fn chip(&mut self) -> &mut Chip {
        &mut self.session.board_mut().chip
    }

    pub fn press_reset(&mut self) {
        self.session.reset_by_pin(self.stop.at, self.stop.instruction_count, self.host);
    }

    /// `pressed` opens the circuit. Its third contact cuts the supply of the drivers, which forget the microstep.
    pub fn set_emergency_stop(&mut self, pressed: bool) {
        self.wiring.press_stop(pressed);
        if pressed {
            self.plant(|plant| {
                for name in [StageName::Sensor, StageName::Lens] {
                    plant.stage_mut(name).reset_sequencer();
                }
            });
        }
    }

    pub fn set_driver_fault(&mut self, stage: StageName, fault: bool) {
        let at = self.stop.at;
        self.chip().drive_pin(at, pins(stage).diagnosis, Level::from(fault));
    }

    pub fn disconnect(&mut self, chip: SpiChip, cut: bool) {
        self.chip().disconnect(chip, cut);
    }

    /// Below the brown-out level the chip stays in reset until the supply has risen above it.
    pub fn set_supply_mv(&mut self, millivolts: u32) {
        let at = self.stop.at;
        let held = self.chip().dips(millivolts);
        self.chip().hold(at, held);
        self.chip().part().set_supply(millivolts);
    }

    /// Volatile memory is lost when the power goes off.
    pub fn set_power(&mut self, on: bool) {
        let at = self.stop.at;
        if on && !self.session.unpowered() {
            return;
        }
        self.chip().power(at, on);
        if !on {
            forget(self.host);
        }
    }

    pub fn set_outer_clock(&mut self, there: bool) {
        let at = self.stop.at;
        self.chip().set_outer_clock(at, there);
    }

    /// Lets the supply dip to 2 V; a chip without brown-out reset keeps running.
    pub fn brown_out(&mut self) {
        if !self.chip().is_off() && self.chip().dips(DIP_MV) {
            self.press_reset();
        }
    }

    pub fn set_memory_make(&mut self, make: MemoryMake) {
        if let Some(memory) = self.chip().memory() {
            memory.set_make(make);
        }
    }

    /// Flips one bit in each of the next `names` identification answers and `reads` reads of the FRAM.
    pub fn spoil_memory_answers(&mut self, names: u32, reads: u32) {
        if let Some(memory) = self.chip().memory() {
            memory.spoil_answers(names, reads);
        }
    }

    pub fn conversions_without_indicator(&mut self) -> u64 {
        self.chip().gauge_converter().map_or(0, |converter| converter.without_indicator())
    }

    pub fn short_conversion_pulses(&mut self) -> u64 {
        self.chip().gauge_converter().map_or(0, |converter| converter.short_pulses())
    }

    pub fn fail_power_after_memory_bytes(&mut self, bytes: u64) {
        if let Some(memory) = self.chip().memory() {
            memory.fail_after(bytes);
        }
    }

    pub fn keep_power(&mut self) {
        if let Some(memory) = self.chip().memory() {
            memory.keep_supply();
        }
    }

    pub fn memory(&mut self) -> Vec<u8> {
        self.chip().memory().map(|memory| memory.contents().to_vec()).unwrap_or_default()
    }

    pub fn change_memory(&mut self, change: impl FnOnce(&mut [u8])) {
        let mut contents = self.memory();
        change(&mut contents);
        let Ok(contents) = contents.try_into() else { return };
        if let Some(memory) = self.chip().memory() {
            memory.set_contents(&contents);
        }
    }

    /// Writes a chip register as a stray pointer would.
    pub fn write_register(&mut self, address: u64, value: u64) {
        let at = self.stop.at;
        // A stray pointer may also hit an address without a register.
        let _ = Operate::write(self.chip(), at, address, Width::W32, value);
    }

    pub fn read_word(&mut self, address: u64) -> Option<u32> {
        Memory::read(self.host, address, Width::W32).ok().map(|word| word as u32)
    }

    pub fn write_word(&mut self, address: u64, value: u32) {
        let _ = Memory::write(self.host, address, Width::W32, u64::from(value));
    }

    /// Copies `code` to free RAM and redirects to it the first function pointer that `is_function` finds in
    /// the variable (address, length). Returns `false` without one.
    pub fn redirect_program(
        &mut self,
        (variable, length): (u64, u64),
        is_function: impl Fn(u32) -> bool,
        code: &[u16],
    ) -> bool {
        let mut words = (variable..variable + length).step_by(4);
        let found = words.find(|at| self.read_word(*at).is_some_and(&is_function));
        let Some(at) = found else { return false };
        for (half, i) in code.iter().zip(0..) {
            if Memory::write(self.host, FREE_RAM + 2 * i, Width::W16, u64::from(*half)).is_err() {
                return false;
            }
        }
        self.write_word(at, FREE_RAM as u32 | 1);
        true
    }

    /// Largest stack depth since reset, bytes, from the start-up paint.
    pub fn stack_depth(&mut self) -> u64 {
        let (begin, length) = STACK;
        let painted = (begin..begin + length)
            .step_by(4)
            .take_while(|address| Memory::read(self.host, *address, Width::W32).ok() == Some(STACK_PAINT));
        length - 4 * painted.count() as u64
    }

    /// Brightness of both light outputs, 0 to 1.
    pub fn lights(&mut self) -> [f64; 2] {
        self.wiring.lights().levels()
    }

    /// Brightness changes since the last call, virtual nanoseconds; the first call starts the recording.
    pub fn take_light_changes(&mut self) -> Vec<(u64, [f64; 2])> {
        self.wiring.lights().take_changes()
    }

    pub fn record_steps(&mut self) {
        self.wiring.record_steps();
    }

    /// Recorded STEP edges of stages A and B, virtual nanoseconds.
    pub fn take_steps(&mut self) -> [Vec<u64>; 2] {
        self.wiring.take_steps()
    }

    pub fn lines(&mut self) -> &mut Lines {
        self.lines
    }

    pub fn send_noise(&mut self, bytes: usize) {
        let mut noise = Noise::new(self.stop.at.0, "noise on the line");
        let bytes: Vec<u8> = (0..bytes).map(|_| noise.bits() as u8).collect();
        self.line.send(&bytes);
    }

    pub fn set_framing_errors(&mut self, per_million: u32) {
        let seed = self.stop.at.0;
        self.chip().set_framing_errors(per_million, seed);
    }

    /// Adds counts that the shaft has not made.
    pub fn slip_encoder(&mut self, stage: StageName, counts: i64) {
        self.wiring.slip_encoder(stage, counts);
    }

    pub fn cut_encoder(&mut self, stage: StageName, cut: bool) {
        self.wiring.cut_encoder(stage, cut);
    }

    /// False switch openings per second while the driver is on; `None` restores the part's value.
    pub fn set_switch_noise(&mut self, stage: StageName, per_s: Option<f64>) {
        let per_s = per_s.unwrap_or(self.parts.switches.glitches_per_s);
        self.wiring.set_glitches_per_s(self.stop.at.0, stage, per_s);
    }

    pub fn set_camera_ignores_triggers(&mut self, ignores: bool) {
        self.wiring.camera_mut().set_ignores_triggers(ignores);
    }

    pub fn set_camera_delay_ns(&mut self, delay_ns: u64) {
        self.wiring.camera_mut().set_delay_ns(delay_ns);
    }

    pub fn cut_strobe(&mut self, cut: bool) {
        let at = self.stop.at;
        self.wiring.cut_strobe(&mut self.session.board_mut().chip, at, cut);
    }

    pub fn expose(&mut self, exposure_us: u64, id: u32) {
        self.wiring.camera_mut().expose(self.stop.at.0, exposure_us * 1000, id);
    }

    pub fn run_camera_freely(&mut self, period_us: u64, exposure_us: u64) {
        self.wiring.camera_mut().run_freely(self.stop.at.0, period_us * 1000, exposure_us * 1000);
    }
}

/// Fills volatile memory with random contents, as after power-on.
pub fn forget(host: &mut dyn Host) {
    let mut noise = Noise::new(0, "memory at power-on");
    for (begin, length) in RAM {
        for address in (begin..begin + length).step_by(8) {
            // The emulator has these memories; a refused write changes nothing.
            let _ = Memory::write(host, address, Width::W64, noise.bits());
        }
    }
}
