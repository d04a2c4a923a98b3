//! The emulated board: STM32F427, 8 MHz clock, two chips on SPI3, FRAM on SPI4, link on USART3, external pin
//! levels. The firmware targets the STM32F429ZI: the F427 with a display controller (same manual, RM0090).

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

/// SYSCLK; also the emulator's instructions per second, because [`Metered`] counts cycles.
const SYSCLK_HZ: u64 = 168_000_000;
const HSE_HZ: u64 = 8_000_000;
pub const SUPPLY_MV: u32 = 3300;
/// Address of the unique id (RM0090, section 39.1).
const UNIQUE_ID_AT: u64 = 0x1FFF_7A10;

/// RCC_CSR after resets that the emulator lacks (RM0090, 6.3.21): power-on also sets PORRSTF, brown-out not.
const CSR_POWER_ON: u64 = 0x0e00_0000;
const CSR_BROWN_OUT: u64 = 0x0600_0000;
/// Rise above the falling threshold that ends a brown-out reset (DS9405, table 22, V_BORhyst, typical).
const BROWN_OUT_HYSTERESIS_MV: u32 = 100;

/// SPI3, SPI4 and USART3 in the emulator's tables.
const SPI3: usize = 2;
const SPI4: usize = 3;
const USART3: usize = 2;
pub const TIM2: usize = 0;
pub const TIM3: usize = 1;
pub const TIM4: usize = 2;
pub const TIM1: usize = 0;
pub const TIM8: usize = 1;

/// Volatile memory, start and length: SRAM1 to 3, then CCM.
pub const RAM: [(u64, u64); 2] = [(0x2000_0000, 192 << 10), (0x1000_0000, 64 << 10)];

/// Unmapped range below the SRAM, where a stack overflow ends: a bus error, which the emulator lacks.
pub const NOTHING: std::ops::Range<u64> = 0x1fff_c010..0x2000_0000;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SpiChip {
    Dac,
    Gauge,
    Memory,
}

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

    pub fn pin(self) -> Pin {
        // The constants below use valid pin numbers only.
        Pin::new(self.pin & 15).unwrap_or_else(|| unreachable!("four bits name a pin"))
    }
}

#[derive(Clone, Copy, Debug)]
pub struct StagePins {
    /// STEP with its advanced timer and alternate function.
    pub step: (PinName, usize, u8),
    pub direction: PinName,
    pub enable: PinName,
    pub diagnosis: PinName,
    /// Encoder A and B with the general timer that counts them (alternate function 2).
    pub encoder: ([PinName; 2], usize),
    pub home: PinName,
    pub far: PinName,
    /// Break input of the STEP timer for the emergency stop, with its alternate function.
    pub stop: (PinName, u8),
}

/// Stage A (alternate functions: DS9405, table 12).
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

pub const fn pins(stage: StageName) -> &'static StagePins {
    match stage {
        StageName::Sensor => &SENSOR_PINS,
        StageName::Lens => &LENS_PINS,
    }
}

pub const TRIGGER: PinName = PinName::new(b'B', 10);
pub const STROBE: PinName = PinName::new(b'B', 11);
pub const LIGHTS: [PinName; 2] = [PinName::new(b'B', 14), PinName::new(b'B', 15)];
/// Strap that marks an emulated board.
const STRAP: PinName = PinName::new(b'D', 15);

pub struct Chip {
    part: Stm32f427,
    pins: BTreeMap<PinName, Level>,
    inputs: BTreeMap<(usize, Channel), Level>,
    /// Last level of each break input, in the order of the advanced timers; cleared by a reset.
    breaks: [Option<Level>; 2],
    /// Reset flags for the next reset where they differ from the emulator's.
    reset_flags: Option<u64>,
    supply: SupplyParts,
    /// Brown-out level read from the option bytes at the last reset.
    brown_out: u64,
    /// The power is off.
    cut: bool,
    /// The supply is below the brown-out level.
    held: bool,
    clock: Arc<OuterClock>,
}

impl Chip {
    pub fn part(&mut self) -> &mut Stm32f427 {
        &mut self.part
    }

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

    pub fn drive_timer(&mut self, at: VirtualNanos, timer: usize, channel: Channel, level: Level) {
        if self.inputs.insert((timer, channel), level) != Some(level) {
            self.put_input(at, timer, channel, level);
        }
    }

    fn put_input(&mut self, at: VirtualNanos, timer: usize, channel: Channel, level: Level) {
        self.part.drive_timer(at, timer, |tim, registers, context| {
            tim.drive_input(channel, level, registers, context);
            // The emulator checks interrupts only at events. A timer without interrupts needs none, which
            // saves a stop per encoder edge.
            if registers.get(tim3::Register::Dier) != 0 {
                context.schedule(at);
            }
        });
    }

    pub fn level(&mut self, name: PinName) -> Level {
        let (port, registers) = self.part.port(name.port);
        port.level(name.pin(), registers)
    }

    /// Copies the emergency stop's level to the timers' break inputs that the firmware has selected.
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

    pub fn set_framing_errors(&mut self, per_million: u32, seed: u64) {
        let errors = self.part.usart[USART3].errors_mut();
        errors.framing = rigless::chip::uart::Rate { name: "framing", per_million };
        errors.seed = seed;
    }

    /// Stops or restarts the HSE clock. Without clock security the chip halts until the next power cycle.
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

    pub fn power(&mut self, at: VirtualNanos, on: bool) {
        self.cut = !on;
        if !on {
            self.reset_flags = None; // those of a power-on follow
        } else if let Some(memory) = self.memory() {
            memory.power_up(at);
        }
        self.request_power(at);
    }

    /// Holds the chip in reset, or releases it. The volatile memory and the other chips keep their supply.
    pub fn hold(&mut self, at: VirtualNanos, held: bool) {
        if std::mem::replace(&mut self.held, held) != held {
            self.request_power(at);
        }
    }

    pub fn is_cut(&self) -> bool {
        self.cut
    }

    /// Without power, or held in reset.
    pub fn is_off(&self) -> bool {
        self.cut || self.held
    }

    fn request_power(&mut self, at: VirtualNanos) {
        let on = !self.is_off();
        self.part.drive_port(at, 0, |_, _, context| {
            context.request_power(on);
            // The emulator checks a model's requests only at events.
            context.schedule(at);
        });
    }

    /// Returns whether this supply resets the chip, or keeps it in reset; without brown-out reset it keeps running.
    pub fn dips(&mut self, millivolts: u32) -> bool {
        let hysteresis_mv = if self.held { BROWN_OUT_HYSTERESIS_MV } else { 0 };
        if millivolts >= self.supply.reset_mv(self.brown_out) + hysteresis_mv {
            return false;
        }
        if !self.cut {
            let brown_out = millivolts >= self.supply.power_down_mv;
            let flags = if brown_out { CSR_BROWN_OUT } else { CSR_POWER_ON };
            self.reset_flags = Some(self.reset_flags.unwrap_or(0) | flags);
        }
        true
    }

    /// Brown-out level of the option bytes; takes effect at the next reset.
    fn read_brown_out(&mut self) -> u64 {
        BOR_LEV.get(self.part.flash.committed_options().0)
    }

    /// A wire from data out to data in instead of DAC and converter.
    pub fn loop_converter_bus(&mut self, wire: impl rigless::chip::spi::Peer) {
        self.part.spi[SPI3].attach(wire);
    }

    pub fn gauge_converter(&mut self) -> Option<&mut GaugeConverter> {
        self.part.spi[SPI3].chip_mut::<GaugeConverter>(1)
    }

    pub fn memory(&mut self) -> Option<&mut MemoryChip> {
        self.part.spi[SPI4].chip_mut::<MemoryChip>(0)
    }

    pub fn disconnect(&mut self, chip: SpiChip, cut: bool) {
        let (interface, nth) = match chip {
            SpiChip::Dac => (SPI3, 0),
            SpiChip::Gauge => {
                // The emulator reads a silent chip as zeros; this line has a pull-up.
                if let Some(converter) = self.gauge_converter() {
                    converter.cut(cut);
                }
                return;
            }
            SpiChip::Memory => (SPI4, 0),
        };
        // The result only reports whether the chip exists; `RigBoard::new` adds all of them.
        let _ = self.part.spi[interface].silence(nth, cut);
    }

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
        // The emulator has no power-on reset; only the flags differ. It also resets the part when its supply is cut.
        let off = self.is_off();
        let (cause, flags) = match cause {
            ResetCause::PowerOn if off => (ResetCause::Pin, None),
            ResetCause::PowerOn => (ResetCause::Pin, Some(self.reset_flags.take().unwrap_or(CSR_POWER_ON))),
            other if off => (other, None),
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
        // A reset floats the chip's pins; external levels persist.
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

#[derive(Debug)]
pub struct RigBoard {
    pub chip: Chip,
    unique_id: [u8; 12],
    costs: Costs,
    program: u64,
}

impl RigBoard {
    /// `seed` sets the unique id, `program` is the fingerprint of the firmware.
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
            cut: false,
            held: false,
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

// No snapshots: every run starts at power-on.
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
