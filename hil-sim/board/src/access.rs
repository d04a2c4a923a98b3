//! Access to a running rig between two instructions: press its buttons, break its parts, take its power away, look into
//! the chip's memory.

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

/// What the supply dips to where only the brown-out reset notices: below what the chip is specified for (1.7 V is where its
/// power-down reset comes at the latest).
const DIP_MV: u32 = 2_000;
/// What cortex-m-rt paints the stack with before the program runs.
const STACK_PAINT: u64 = 0xcccc_cccc;
/// Where the firmware's stack lies, see its `memory.x`: first address and length.
pub const STACK: (u64, u64) = (0x2000_0000, 128 << 10);
/// RAM that the firmware does not use: its variables end well before.
const FREE_RAM: u64 = 0x2002_f000;

/// A rig that stands still between two instructions, for tests that break it or look into it.
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

    /// Presses the reset button.
    pub fn press_reset(&mut self) {
        self.session.reset_by_pin(self.stop.at, self.stop.instruction_count, self.host);
    }

    /// Presses the emergency stop (its circuit opens), or releases it.
    pub fn set_emergency_stop(&mut self, pressed: bool) {
        let at = self.stop.at;
        for stage in [StageName::Sensor, StageName::Lens] {
            self.chip().drive_pin(at, pins(stage).stop.0, Level::from(pressed));
        }
        self.chip().join_breaks(at);
    }

    /// The stepper driver reports a fault on DIAG, or takes it back.
    pub fn set_driver_fault(&mut self, stage: StageName, fault: bool) {
        let at = self.stop.at;
        self.chip().drive_pin(at, pins(stage).diagnosis, Level::from(fault));
    }

    /// Cuts the data lines of a chip, or mends them.
    pub fn disconnect(&mut self, chip: SpiChip, cut: bool) {
        self.chip().disconnect(chip, cut);
    }

    /// Sets the supply, millivolts. Below the level of the option bytes the chip resets.
    pub fn set_supply_mv(&mut self, millivolts: u32) {
        if self.chip().dips(millivolts) {
            self.press_reset();
        }
        self.chip().part().set_supply(millivolts);
    }

    /// Takes the power away: what is in the volatile memory is lost. Or gives it back.
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

    /// The ST-LINK's clock stops, or comes back.
    pub fn set_outer_clock(&mut self, there: bool) {
        let at = self.stop.at;
        self.chip().set_outer_clock(at, there);
    }

    /// The supply dips to 2 V, so shortly that only a brown-out reset notices; a chip whose option bytes leave that off runs on.
    pub fn brown_out(&mut self) {
        if self.chip().dips(DIP_MV) {
            self.press_reset();
        }
    }

    /// Another make of FRAM is soldered in, or none.
    pub fn set_memory_make(&mut self, make: MemoryMake) {
        if let Some(memory) = self.chip().memory() {
            memory.set_make(make);
        }
    }

    /// Flips a bit on the bus in each of the FRAM's next so many answers to the question for its name, and in so many reads.
    pub fn spoil_memory_answers(&mut self, names: u32, reads: u32) {
        if let Some(memory) = self.chip().memory() {
            memory.spoil_answers(names, reads);
        }
    }

    /// Conversions of the gauge that were read without a busy indicator.
    pub fn conversions_without_indicator(&mut self) -> u64 {
        self.chip().gauge_converter().map_or(0, |converter| converter.without_indicator())
    }

    /// Pulses of CNV that were too short for the gauge's converter.
    pub fn short_conversion_pulses(&mut self) -> u64 {
        self.chip().gauge_converter().map_or(0, |converter| converter.short_pulses())
    }

    /// Lets the power fail when the firmware has written this many more bytes to its memory.
    pub fn fail_power_after_memory_bytes(&mut self, bytes: u64) {
        if let Some(memory) = self.chip().memory() {
            memory.fail_after(bytes);
        }
    }

    /// The power does not fail after all.
    pub fn keep_power(&mut self) {
        if let Some(memory) = self.chip().memory() {
            memory.keep_supply();
        }
    }

    /// What the memory holds.
    pub fn memory(&mut self) -> Vec<u8> {
        self.chip().memory().map(|memory| memory.contents().to_vec()).unwrap_or_default()
    }

    /// Changes what the memory holds.
    pub fn change_memory(&mut self, change: impl FnOnce(&mut [u8])) {
        let mut contents = self.memory();
        change(&mut contents);
        let Ok(contents) = contents.try_into() else { return };
        if let Some(memory) = self.chip().memory() {
            memory.set_contents(&contents);
        }
    }

    /// Writes a register of the chip behind the firmware's back, as a stray pointer would.
    pub fn write_register(&mut self, address: u64, value: u64) {
        let at = self.stop.at;
        // An address without a register is what a stray pointer may have, too.
        let _ = Operate::write(self.chip(), at, address, Width::W32, value);
    }

    /// Reads a word of the chip's volatile memory.
    pub fn read_word(&mut self, address: u64) -> Option<u32> {
        Memory::read(self.host, address, Width::W32).ok().map(|word| word as u32)
    }

    /// Writes a word of the chip's volatile memory, as a stray pointer would.
    pub fn write_word(&mut self, address: u64, value: u32) {
        let _ = Memory::write(self.host, address, Width::W32, u64::from(value));
    }

    /// Lets the firmware go on with this code, as a stray pointer would: the code is laid into free RAM, and the first
    /// word of a variable (its address and length) that `is_function` takes for a pointer to a function is made to point
    /// there. `false` where there is none.
    pub fn lead_astray(
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

    /// The largest depth that the firmware's stack has had since the reset, bytes; start-up code paints it.
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

    /// Changes of their brightness since the last call, in virtual nanoseconds; the first call begins to record.
    pub fn take_light_changes(&mut self) -> Vec<(u64, [f64; 2])> {
        self.wiring.lights().take_changes()
    }

    /// Begins to note when each STEP edge comes.
    pub fn record_steps(&mut self) {
        self.wiring.record_steps();
    }

    /// The STEP edges noted so far, stage A's and stage B's, in virtual nanoseconds.
    pub fn take_steps(&mut self) -> [Vec<u64>; 2] {
        self.wiring.take_steps()
    }

    /// What goes wrong on the line, in both directions.
    pub fn lines(&mut self) -> &mut Lines {
        self.lines
    }

    /// Puts so many random bytes on the line to the board.
    pub fn send_noise(&mut self, bytes: usize) {
        let mut noise = Noise::new(self.stop.at.0, "noise on the line");
        let bytes: Vec<u8> = (0..bytes).map(|_| noise.bits() as u8).collect();
        self.line.send(&bytes);
    }

    /// Of a million bytes that the board hears so many come with a framing error.
    pub fn set_framing_errors(&mut self, per_million: u32) {
        let seed = self.stop.at.0;
        self.chip().set_framing_errors(per_million, seed);
    }

    /// The encoder counts what its shaft has not done.
    pub fn slip_encoder(&mut self, stage: StageName, counts: i64) {
        self.wiring.slip_encoder(stage, counts);
    }

    /// Cuts the encoder's wires, or mends them.
    pub fn cut_encoder(&mut self, stage: StageName, cut: bool) {
        self.wiring.cut_encoder(stage, cut);
    }

    /// So many false openings of the stage's switches a second while its driver is on; `None`: as its parts have it.
    pub fn set_switch_noise(&mut self, stage: StageName, per_s: Option<f64>) {
        let per_s = per_s.unwrap_or(self.parts.switches.glitches_per_s);
        self.wiring.set_glitches_per_s(self.stop.at.0, stage, per_s);
    }

    /// The camera hears no trigger, or hears them again.
    pub fn set_camera_deaf(&mut self, deaf: bool) {
        self.wiring.camera_mut().set_deaf(deaf);
    }

    /// The camera takes so much longer to read a frame out.
    pub fn set_camera_delay_ns(&mut self, delay_ns: u64) {
        self.wiring.camera_mut().set_delay_ns(delay_ns);
    }

    /// Cuts the wire of the strobe, or mends it.
    pub fn cut_strobe(&mut self, cut: bool) {
        let at = self.stop.at;
        self.wiring.cut_strobe(&mut self.session.board_mut().chip, at, cut);
    }

    /// The camera's host triggers it by software, for an image of this name.
    pub fn expose(&mut self, exposure_us: u64, id: u32) {
        self.wiring.camera_mut().expose(self.stop.at.0, exposure_us * 1000, id);
    }

    /// The camera's host lets it run freely, or (period 0) stops that.
    pub fn run_camera_freely(&mut self, period_us: u64, exposure_us: u64) {
        self.wiring.camera_mut().run_freely(self.stop.at.0, period_us * 1000, exposure_us * 1000);
    }
}

/// The volatile memory loses what it held: at power-on it holds what nobody chose.
pub fn forget(host: &mut dyn Host) {
    let mut noise = Noise::new(0, "memory at power-on");
    for (begin, length) in RAM {
        for address in (begin..begin + length).step_by(8) {
            // The emulator has these memories; what it refused would stay as it was.
            let _ = Memory::write(host, address, Width::W64, noise.bits());
        }
    }
}
