//! The board as the emulator sees it: one STM32F427, an 8 MHz clock, two chips on SPI3, the FRAM on SPI4, the link on
//! USART3, and the levels that the outside puts on its pins.
//!
//! The firmware is built for the STM32F429ZI, which is the F427 plus a display controller (one reference manual,
//! RM0090); the emulator has the F427.

use std::{
    collections::BTreeMap,
    num::{NonZeroU32, NonZeroU64},
    path::Path,
    sync::Arc,
};

use rigless::{
    cpu::armv7m::windows,
    device::{ErasedDevice, Level, ResetCause},
    image::Image,
    machine::{
        Board, Target,
        armv7m::{Core, Fpu, MpuRegions, Variant},
    },
    mcu::{Mcu, Operate},
    snapshot::Store,
    soc::{
        Bus,
        st::tim::{BreakInput, BreakSource, Channel},
        stm32f427::{
            Stm32f427,
            generated::{flash::optcr::BOR_LEV, rcc, tim3},
            peripherals::{gpio::Pin, spi::Select},
        },
    },
    time::VirtualNanos,
};

use crate::{
    chips::{Dac, GaugeConverter, SharedPlant},
    memory::MemoryChip,
    parts::{Parts, SupplyParts},
    plant::{Noise, StageName},
    processor::{Costs, Metered, OuterClock},
    serial::Line,
};

/// SYSCLK; also what the emulator takes for instructions per second: [`Metered`] counts cycles.
const SYSCLK_HZ: u64 = 168_000_000;
const HSE_HZ: u64 = 8_000_000;
/// The supply as it should be, millivolts.
pub const SUPPLY_MV: u32 = 3300;
/// Where the chip keeps its unique id (RM0090, section 39.1).
const UNIQUE_ID_AT: u64 = 0x1FFF_7A10;

/// RCC_CSR after each kind of reset that the emulator's part does not know (RM0090, section 6.3.21): power-on sets
/// PORRSTF, PINRSTF and BORRSTF; a brown-out the last two.
const CSR_POWER_ON: u64 = 0x0e00_0000;
const CSR_BROWN_OUT: u64 = 0x0600_0000;

/// SPI3, SPI4 and USART3 in the part's tables.
const SPI3: usize = 2;
const SPI4: usize = 3;
const USART3: usize = 2;
/// TIM2 in the part's table of general timers.
pub const TIM2: usize = 0;
pub const TIM3: usize = 1;
pub const TIM4: usize = 2;
/// TIM1 in the table of advanced timers.
pub const TIM1: usize = 0;
pub const TIM8: usize = 1;

/// The volatile memory of the chip: where it begins and how long it is. SRAM1 to 3, and the core's own.
pub const RAM: [(u64, u64); 2] = [(0x2000_0000, 192 << 10), (0x1000_0000, 64 << 10)];

/// Below the SRAM, down to the option bytes, the chip has nothing, and its bus answers every access with an error (RM0090,
/// section 2.3). The emulator would drop it silently; a stack that overflows ends there.
pub const NOTHING: std::ops::Range<u64> = 0x1fff_c010..0x2000_0000;

/// A chip on SPI3 or SPI4.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SpiChip {
    /// The piezo's DAC.
    Dac,
    /// The gauge's converter.
    Gauge,
    Memory,
}

/// A pin of the chip: port A is 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct PinName {
    /// Port, A = 0.
    pub port: usize,
    pub pin: u8,
}

impl PinName {
    const fn new(port: u8, pin: u8) -> Self {
        Self { port: (port - b'A') as usize, pin }
    }

    /// The emulator's name of the pin.
    pub fn pin(self) -> Pin {
        // The constants below name pins that every port has.
        Pin::new(self.pin & 15).unwrap_or_else(|| unreachable!("four bits name a pin"))
    }
}

/// The wires of one motorised stage.
#[derive(Clone, Copy, Debug)]
pub struct StagePins {
    /// STEP, and the advanced timer and alternate function that drive it.
    pub step: (PinName, usize, u8),
    /// DIR, high = sensor and lens away from each other.
    pub direction: PinName,
    pub enable: PinName,
    pub diagnosis: PinName,
    /// Encoder A and B, and the general timer that counts them (alternate function 2).
    pub encoder: ([PinName; 2], usize),
    /// Home switch, high = open = actuated.
    pub home: PinName,
    pub far: PinName,
    /// Break input, which the emergency stop's circuit reaches; the STEP timer's, with its alternate function.
    pub stop: (PinName, u8),
}

/// Stage A's wires (DS9405, table 12, for the alternate functions).
const SENSOR_PINS: StagePins = StagePins {
    step: (PinName::new(b'E', 9), TIM1, 1),
    direction: PinName::new(b'F', 13),
    enable: PinName::new(b'F', 14),
    diagnosis: PinName::new(b'F', 15),
    encoder: ([PinName::new(b'D', 12), PinName::new(b'D', 13)], TIM4),
    home: PinName::new(b'G', 0),
    far: PinName::new(b'G', 1),
    stop: (PinName::new(b'E', 15), 1),
};
/// Stage B's wires.
const LENS_PINS: StagePins = StagePins {
    step: (PinName::new(b'C', 6), TIM8, 3),
    direction: PinName::new(b'F', 0),
    enable: PinName::new(b'F', 1),
    diagnosis: PinName::new(b'F', 2),
    encoder: ([PinName::new(b'B', 4), PinName::new(b'B', 5)], TIM3),
    home: PinName::new(b'G', 2),
    far: PinName::new(b'G', 3),
    stop: (PinName::new(b'A', 6), 3),
};

/// The wires of a stage.
pub const fn pins(stage: StageName) -> &'static StagePins {
    match stage {
        StageName::Sensor => &SENSOR_PINS,
        StageName::Lens => &LENS_PINS,
    }
}

pub const TRIGGER: PinName = PinName::new(b'B', 10);
pub const STROBE: PinName = PinName::new(b'B', 11);
/// Light outputs.
pub const LIGHTS: [PinName; 2] = [PinName::new(b'B', 14), PinName::new(b'B', 15)];
/// Strap that tells the firmware that it is emulated.
const STRAP: PinName = PinName::new(b'D', 15);

/// The chip, and what the outside holds its pins at, which a reset does not change.
pub struct Chip {
    part: Stm32f427,
    pins: BTreeMap<PinName, Level>,
    inputs: BTreeMap<(usize, Channel), Level>,
    /// What each break input was last given, in the order of the advanced timers; a reset forgets it.
    breaks: [Option<Level>; 2],
    /// The flags of the reset that comes, where they are not what the emulator's part makes of it.
    reset_flags: Option<u64>,
    supply: SupplyParts,
    /// The brown-out level, as the option bytes had it at the last reset.
    brown_out: u64,
    clock: Arc<OuterClock>,
}

impl Chip {
    pub fn part(&mut self) -> &mut Stm32f427 {
        &mut self.part
    }

    /// Holds a pin at a level.
    pub fn drive_pin(&mut self, at: VirtualNanos, name: PinName, level: Level) {
        if self.pins.insert(name, level) != Some(level) {
            self.put_pin(at, name, level);
        }
    }

    fn put_pin(&mut self, at: VirtualNanos, name: PinName, level: Level) {
        self.part.drive_port(at, name.port, |port, registers, context| {
            port.drive(name.pin(), Some(level), registers, context);
        });
    }

    /// Holds the input of a general timer's channel at a level.
    pub fn drive_timer(&mut self, at: VirtualNanos, timer: usize, channel: Channel, level: Level) {
        if self.inputs.insert((timer, channel), level) != Some(level) {
            self.put_input(at, timer, channel, level);
        }
    }

    fn put_input(&mut self, at: VirtualNanos, timer: usize, channel: Channel, level: Level) {
        self.part.drive_timer(at, timer, |tim, registers, context| {
            tim.drive_input(channel, level, registers, context);
            // The emulator looks at what an input did to the interrupts only at an event. A timer that asks for none only
            // counts: no need to stop for each edge of an encoder.
            if registers.get(tim3::Register::Dier) != 0 {
                context.schedule(at);
            }
        });
    }

    /// The level of a pin, as a wire on it would have it.
    pub fn level(&mut self, name: PinName) -> Level {
        let (port, registers) = self.part.port(name.port);
        port.level(name.pin(), registers)
    }

    /// Brings the level on the emergency stop's pins to the break inputs of the timers, as far as the firmware has
    /// switched the pins to them.
    pub fn join_breaks(&mut self, at: VirtualNanos) {
        for stage in [StageName::Sensor, StageName::Lens] {
            let StagePins { stop: (pin, function), step: (_, timer, _), .. } = *pins(stage);
            let level = self.level(pin);
            if self.function(pin) == Some(function) && self.breaks[timer].replace(level) != Some(level) {
                self.part.drive_advanced_timer(at, timer, |tim, registers, context| {
                    tim.drive_break_source(BreakInput::First, BreakSource::Pin, level, registers, context);
                    context.schedule(at);
                });
            }
        }
    }

    /// Of a million bytes that the link hears so many come with a framing error; the seed says which.
    pub fn set_framing_errors(&mut self, per_million: u32, seed: u64) {
        let errors = self.part.usart[USART3].errors_mut();
        errors.framing = rigless::chip::uart::Rate { name: "framing", per_million };
        errors.seed = seed;
    }

    /// The clock that the ST-LINK feeds into HSE stops, or comes back. One that drives the system and stops is told by the clock
    /// security system; where the firmware has left that off, the chip stands until its power has been away.
    pub fn set_outer_clock(&mut self, at: VirtualNanos, there: bool) {
        if !self.clock.set(there) || there {
            return;
        }
        let (running, watched) = self.part.drive_clocks(at, |clocks, registers, context| {
            let control = registers.get(rcc::Register::Cr);
            clocks.fail_hse(registers, context);
            context.schedule(at);
            (rcc::cr::HSERDY.is_set(control), rcc::cr::CSSON.is_set(control))
        });
        match (running, watched) {
            (true, true) => self.clock.tell(),
            (true, false) => self.power(at, false),
            (false, _) => {}
        }
    }

    /// Cuts the part's supply or gives it back.
    pub fn power(&mut self, at: VirtualNanos, on: bool) {
        if on && let Some(memory) = self.memory() {
            memory.power_up(at);
        }
        self.part.drive_port(at, 0, |_, _, context| {
            context.request_power(on);
            // What a model asks for is looked at only at an event.
            context.schedule(at);
        });
    }

    /// The supply dips to this for a moment: whether the chip resets itself, and notes why. One whose option bytes leave the
    /// brown-out reset off runs on, whatever it then does.
    pub fn dips(&mut self, millivolts: u32) -> bool {
        if millivolts >= self.supply.reset_mv(self.brown_out) {
            return false;
        }
        let brown_out = millivolts >= self.supply.power_down_mv;
        self.reset_flags = Some(if brown_out { CSR_BROWN_OUT } else { CSR_POWER_ON });
        true
    }

    /// The brown-out level that the option bytes have now; it counts from the next reset on.
    fn read_brown_out(&mut self) -> u64 {
        BOR_LEV.get(self.part.flash.committed_options().0)
    }

    /// The gauge's converter.
    pub fn gauge_converter(&mut self) -> Option<&mut GaugeConverter> {
        self.part.spi[SPI3].chip_mut::<GaugeConverter>(1)
    }

    pub fn memory(&mut self) -> Option<&mut MemoryChip> {
        self.part.spi[SPI4].chip_mut::<MemoryChip>(0)
    }

    /// Cuts the data lines of a chip, or mends them.
    pub fn disconnect(&mut self, chip: SpiChip, cut: bool) {
        let (interface, nth) = match chip {
            SpiChip::Dac => (SPI3, 0),
            SpiChip::Gauge => {
                // A silent chip of the emulator's bus reads as zeros; this line has a pull-up.
                if let Some(converter) = self.gauge_converter() {
                    converter.cut(cut);
                }
                return;
            }
            SpiChip::Memory => (SPI4, 0),
        };
        // It says whether such a chip is there; all are, since `RigBoard::new`.
        let _ = self.part.spi[interface].silence(nth, cut);
    }

    /// The alternate function that a pin is set to.
    pub fn function(&mut self, name: PinName) -> Option<u8> {
        let (_, registers) = self.part.port(name.port);
        rigless::soc::stm32f427::peripherals::gpio::Gpio::function(name.pin(), registers)
    }
}

impl std::fmt::Debug for Chip {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Chip").field("pins", &self.pins).finish_non_exhaustive()
    }
}

impl Mcu for Chip {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        // The emulator's part knows no power-on reset; all that differs is in its flags.
        let (cause, flags) = match cause {
            ResetCause::PowerOn => (ResetCause::Pin, Some(CSR_POWER_ON)),
            other => (other, self.reset_flags.take()),
        };
        self.part.reset(at, cause);
        self.clock.forget();
        if let Some(flags) = flags {
            let (_, registers) = self.part.clocks();
            registers.set(rcc::Register::Csr, flags);
        }
        self.breaks = [None; 2];
        self.brown_out = self.read_brown_out();
        // The part comes back with floating pins; the outside still holds them.
        for (name, level) in self.pins.clone() {
            self.put_pin(at, name, level);
        }
        for ((timer, channel), level) in self.inputs.clone() {
            self.put_input(at, timer, channel, level);
        }
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        self.part.split(slot)
    }
}

/// The NUCLEO-F429ZI with the rig's chips.
#[derive(Debug)]
pub struct RigBoard {
    pub chip: Chip,
    unique_id: [u8; 12],
    costs: Costs,
    /// Tells its program from another one.
    program: u64,
}

impl RigBoard {
    /// Assembles the board of these parts; the seed makes its unique id, `program` tells what it will run from other programs.
    pub fn new(
        plant: &SharedPlant,
        line: Line,
        (seed, program): (u64, u64),
        parts: &Parts,
        costs: Costs,
    ) -> Result<Self, rigless::soc::Error> {
        let mut part = Stm32f427::new()?;
        part.rcc.attach_crystals(HSE_HZ, 0);
        part.set_supply(SUPPLY_MV);
        let select = |pin| Select { port: "GPIOD", pin, active: Level::Low };
        if let (Some(dac), Some(gauge)) = (Pin::new(0), Pin::new(1)) {
            part.spi[SPI3].attach_selected(Dac::new(plant.clone()), select(dac));
            part.spi[SPI3]
                .attach_selected(GaugeConverter::new(plant.clone(), parts.gauge_converter), select(gauge));
        }
        if let Some(pin) = Pin::new(4) {
            let select = Select { port: "GPIOE", pin, active: Level::Low };
            part.spi[SPI4].attach_selected(MemoryChip::new(parts.memory.make), select);
        }
        part.usart[USART3].attach(line);
        let (flash, registers) = part.program();
        let (options, more) = flash.committed_options();
        flash.keep_options(BOR_LEV.set(options, parts.supply.brown_out.bits()), more, registers);
        let mut chip = Chip {
            part,
            pins: BTreeMap::new(),
            inputs: BTreeMap::new(),
            breaks: [None; 2],
            reset_flags: None,
            supply: parts.supply,
            brown_out: parts.supply.brown_out.bits(),
            clock: Arc::default(),
        };
        let start = VirtualNanos(0);
        chip.drive_pin(start, STRAP, Level::High);
        for stage in [StageName::Sensor, StageName::Lens] {
            chip.drive_pin(start, pins(stage).diagnosis, Level::Low);
            // The emergency stop's circuit is closed to ground.
            chip.drive_pin(start, pins(stage).stop.0, Level::Low);
        }
        chip.drive_pin(start, STROBE, Level::Low);
        let mut noise = Noise::new(seed, "unique id");
        let (low, high) = (noise.bits().to_le_bytes(), noise.bits().to_le_bytes());
        let unique_id = core::array::from_fn(|i| if i < 8 { low[i] } else { high[i - 8] });
        Ok(Self { chip, unique_id, costs, program })
    }
}

// No snapshots: a run starts at power-on.
impl Store for RigBoard {}

impl Board for RigBoard {
    fn name(&self) -> &'static str {
        "farnear-nucleo-f429zi"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32f427"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.chip)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let lines = u32::from(Operate::cpu(&self.chip).interrupt_lines);
        let mut core = Core {
            variant: Variant::M4,
            clock_hz: const { NonZeroU64::new(SYSCLK_HZ).unwrap() },
            interrupt_lines: NonZeroU32::new(lines).unwrap_or(NonZeroU32::MIN),
            priority_bits: 4,
            refclk_divider: const { NonZeroU32::new(8).unwrap() },
            instructions_per_second: const { NonZeroU64::new(SYSCLK_HZ).unwrap() },
            boot: "flash",
        }
        .spec_with_parts(&windows(self.chip.bus()), Fpu::FpV4Sp, MpuRegions::Eight);
        if let Ok(id) = Image::new(Path::new("unique id"), self.unique_id.to_vec(), Some(UNIQUE_ID_AT)) {
            core.factory_images.push(id);
        }
        let (processor, costs, clock) =
            (core.processor.clone(), self.costs.clone(), Arc::clone(&self.chip.clock));
        let program = self.program;
        core.processor = Arc::new(move |endian| {
            let clock = Arc::clone(&clock);
            Ok(Box::new(Metered::new(program, || processor(endian), costs.clone(), clock)?))
        });
        vec![Target::new("stm32f427", &mut self.chip, core)]
    }
}
