//! What can be done to a running rig: press its buttons, break its parts, take its power away.

use rigless::{
    device::Level,
    emulator::{Host, Memory, Stop},
    mcu::Operate,
    session::Session,
    soc::Width,
};
use serde::Deserialize;

use crate::{
    board::{Chip, RAM, RigBoard, SUPPLY_MV, SpiChip, pins},
    chips::{SharedPlant, with_plant},
    plant::{Noise, Plant, StageName},
    wiring::Wiring,
};

/// What cortex-m-rt paints the stack with before the program runs.
const STACK_PAINT: u64 = 0xcccc_cccc;
/// Where the firmware's stack lies, see its `memory.x`: first address and length.
pub const STACK: (u64, u64) = (0x2000_0000, 128 << 10);
/// RAM that the firmware does not use: its variables end well before.
const FREE_RAM: u64 = 0x2002_f000;
/// A supply at which the chip still runs but its detector speaks up (the firmware sets it to 2.93 V).
const LOW_SUPPLY_MV: u32 = 2800;

/// Something that may happen to a rig.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// Somebody presses the emergency stop, or its wire breaks.
    EmergencyStop,
    /// The emergency stop is released.
    EmergencyStopReleased,
    /// The reset button is pressed.
    ResetButton,
    /// The power goes.
    PowerLoss,
    /// The power comes back.
    PowerReturn,
    /// The supply dips for so short a time that only the brown-out reset notices.
    BrownOut,
    /// The supply sinks to 2.8 V.
    SupplyLow,
    /// The supply is as it should be.
    SupplyNormal,
    /// The motor's driver reports a fault.
    DriverFault,
    /// The motor's driver takes it back.
    DriverFine,
    /// The motor is held fast.
    MotorStalls,
    /// The motor is free again.
    MotorFree,
    /// The home switch says for ever that it is open (not actuated).
    HomeSwitchDead,
    /// The piezo amplifier's chips no longer answer.
    PiezoDead,
    /// The program counter goes astray: the firmware's clock stands still.
    FirmwareHangs,
    /// A bit of the memory flips.
    MemoryBitFlips,
}

/// Something that happens, and to what.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Happening {
    /// When, in milliseconds of virtual time after power-on.
    pub after_ms: u64,
    /// What.
    pub what: What,
    /// The stage concerned, if one is.
    #[serde(default = "sensor")]
    pub stage: StageName,
    /// The address of the memory concerned, if one is.
    #[serde(default)]
    pub address: u16,
    /// The bit there.
    #[serde(default)]
    pub bit: u8,
}

fn sensor() -> StageName {
    StageName::Sensor
}

/// TIM5, which keeps the firmware's time.
const TIM5_CR1: u64 = 0x4000_0c00;

/// The inside of the rig, for tests that break it.
pub struct Hands<'a, 'h> {
    pub(crate) session: &'a mut Session<RigBoard>,
    pub(crate) host: &'a mut (dyn Host + 'h),
    pub(crate) stop: Stop,
    pub(crate) plant: &'a SharedPlant,
    pub(crate) wiring: &'a mut Wiring,
}

impl Hands<'_, '_> {
    /// Works on the plant.
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

    /// Sets the supply, millivolts. The emulator's chip knows its detector but no brown-out: for that, see
    /// [`Hands::brown_out`].
    pub fn set_supply_mv(&mut self, millivolts: u32) {
        self.chip().part().set_supply(millivolts);
    }

    /// Takes the power away: what is in the volatile memory is lost. Or gives it back.
    pub fn set_power(&mut self, on: bool) {
        let at = self.stop.at;
        self.chip().power(at, on);
        if !on {
            forget(self.host);
        }
    }

    /// The supply dips just long enough to reset the chip.
    pub fn brown_out(&mut self) {
        self.chip().expect_brown_out();
        self.press_reset();
    }

    /// Lets the power fail when the firmware has written this many more bytes to its memory.
    pub fn fail_power_after_memory_bytes(&mut self, bytes: u64) {
        if let Some(memory) = self.chip().memory() {
            memory.fail_after(bytes);
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

    /// Begins to note when each STEP edge comes.
    pub fn record_steps(&mut self) {
        self.wiring.record_steps();
    }

    /// The STEP edges noted so far, stage A's and stage B's, in virtual nanoseconds.
    pub fn take_steps(&mut self) -> [Vec<u64>; 2] {
        self.wiring.take_steps()
    }

    /// The camera's host triggers it by software, for an image of this name.
    pub fn expose(&mut self, exposure_us: u64, id: u32) {
        self.wiring.camera_mut().expose(self.stop.at.0, exposure_us * 1000, id);
    }

    /// The camera's host lets it run freely, or (period 0) stops that.
    pub fn run_camera_freely(&mut self, period_us: u64, exposure_us: u64) {
        self.wiring.camera_mut().run_freely(self.stop.at.0, period_us * 1000, exposure_us * 1000);
    }

    /// Lets something happen.
    pub fn happen(&mut self, happening: &Happening) {
        let stage = happening.stage;
        match happening.what {
            What::EmergencyStop => self.set_emergency_stop(true),
            What::EmergencyStopReleased => self.set_emergency_stop(false),
            What::ResetButton => self.press_reset(),
            What::PowerLoss => self.set_power(false),
            What::PowerReturn => self.set_power(true),
            What::BrownOut => self.brown_out(),
            What::SupplyLow => self.set_supply_mv(LOW_SUPPLY_MV),
            What::SupplyNormal => self.set_supply_mv(SUPPLY_MV),
            What::DriverFault => self.set_driver_fault(stage, true),
            What::DriverFine => self.set_driver_fault(stage, false),
            What::MotorStalls => self.plant(|plant| plant.stage_mut(stage).set_stalled(true)),
            What::MotorFree => self.plant(|plant| plant.stage_mut(stage).set_stalled(false)),
            What::HomeSwitchDead => self.plant(|plant| plant.stage_mut(stage).set_stuck_home(Some(false))),
            What::PiezoDead => {
                self.disconnect(SpiChip::Dac, true);
                self.disconnect(SpiChip::Gauge, true);
            }
            What::FirmwareHangs => self.write_register(TIM5_CR1, 0),
            What::MemoryBitFlips => self.change_memory(|contents| {
                let address = usize::from(happening.address) % contents.len().max(1);
                if let Some(byte) = contents.get_mut(address) {
                    *byte ^= 1 << (happening.bit & 7);
                }
            }),
        }
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
