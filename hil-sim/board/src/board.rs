//! The board as the emulator sees it: one STM32F427, an 8 MHz clock, two chips on SPI3, the link on USART3, and
//! the levels that the outside puts on its pins.
//!
//! The firmware is built for the STM32F429ZI, which is the F427 plus a display controller (one reference manual,
//! RM0090); the emulator has the F427.

use std::{
    collections::BTreeMap,
    num::{NonZeroU32, NonZeroU64},
    path::Path,
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
        st::tim::Channel,
        stm32f427::{
            Stm32f427,
            peripherals::{gpio::Pin, spi::Select},
        },
    },
    time::VirtualNanos,
};

use crate::{
    chips::{Dac, GaugeConverter, SharedPlant},
    plant::Noise,
    serial::Line,
};

/// SYSCLK; also the instructions per second, so that the cycle counter counts what it should.
const SYSCLK_HZ: u64 = 168_000_000;
const HSE_HZ: u64 = 8_000_000;
const SUPPLY_MV: u32 = 3300;
/// Where the chip keeps its unique id (RM0090, section 39.1).
const UNIQUE_ID_AT: u64 = 0x1FFF_7A10;

/// SPI3, USART3, TIM2, TIM4 and TIM5 in the part's tables.
const SPI3: usize = 2;
const USART3: usize = 2;
/// TIM2 in the part's table of general timers.
pub const TIM2: usize = 0;
/// TIM4 likewise.
pub const TIM4: usize = 2;
/// TIM1 in the table of advanced timers.
pub const TIM1: usize = 0;

/// A chip on SPI3, in the order in which the board attaches them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SpiChip {
    /// The piezo's DAC.
    Dac,
    /// The gauge's converter.
    Gauge,
}

/// A pin of the chip: port A is 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct PinName {
    /// Port, A = 0.
    pub port: usize,
    /// Pin, 0 to 15.
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

/// STEP.
pub const STEP: PinName = PinName::new(b'E', 9);
/// DIR, high = away from the lens.
pub const DIR: PinName = PinName::new(b'F', 13);
/// EN, low = on.
pub const ENABLE: PinName = PinName::new(b'F', 14);
/// DIAG, high = fault.
pub const DIAG: PinName = PinName::new(b'F', 15);
/// Encoder, channel A.
pub const ENCODER_A: PinName = PinName::new(b'D', 12);
/// Encoder, channel B.
pub const ENCODER_B: PinName = PinName::new(b'D', 13);
/// Home switch, high = closed (actuated).
pub const HOME: PinName = PinName::new(b'G', 0);
/// Far switch, high = closed (actuated).
pub const FAR: PinName = PinName::new(b'G', 1);
/// Camera trigger.
pub const TRIGGER: PinName = PinName::new(b'B', 10);
/// Camera strobe.
pub const STROBE: PinName = PinName::new(b'B', 11);
/// Strap that tells the firmware that it is emulated.
const STRAP: PinName = PinName::new(b'D', 15);

/// The chip, and what the outside holds its pins at, which a reset does not change.
pub struct Chip {
    part: Stm32f427,
    pins: BTreeMap<PinName, Level>,
    inputs: BTreeMap<(usize, Channel), Level>,
}

impl Chip {
    /// The part itself.
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
            // The emulator looks at what an input did to the interrupts only at an event.
            context.schedule(at);
        });
    }

    /// The level of a pin, as a wire on it would have it.
    pub fn level(&mut self, name: PinName) -> Level {
        let (port, registers) = self.part.port(name.port);
        port.level(name.pin(), registers)
    }

    /// Cuts the data lines of a chip on SPI3, or mends them.
    pub fn disconnect(&mut self, chip: SpiChip, cut: bool) {
        // It says whether such a chip is there; both are, since `RigBoard::new`.
        let _ = self.part.spi[SPI3].silence(chip as usize, cut);
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
        self.part.reset(at, cause);
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
    /// The chip.
    pub chip: Chip,
    unique_id: [u8; 12],
}

impl RigBoard {
    /// Assembles the board; the seed makes its unique id.
    pub fn new(plant: &SharedPlant, line: Line, seed: u64) -> Result<Self, rigless::soc::Error> {
        let mut part = Stm32f427::new()?;
        part.rcc.attach_crystals(HSE_HZ, 0);
        part.set_supply(SUPPLY_MV);
        let select = |pin| Select { port: "GPIOD", pin, active: Level::Low };
        if let (Some(dac), Some(gauge)) = (Pin::new(0), Pin::new(1)) {
            part.spi[SPI3].attach_selected(Dac::new(plant.clone()), select(dac));
            part.spi[SPI3].attach_selected(GaugeConverter::new(plant.clone()), select(gauge));
        }
        part.usart[USART3].attach(line);
        let mut chip = Chip { part, pins: BTreeMap::new(), inputs: BTreeMap::new() };
        let start = VirtualNanos(0);
        chip.drive_pin(start, STRAP, Level::High);
        chip.drive_pin(start, DIAG, Level::Low);
        chip.drive_pin(start, STROBE, Level::Low);
        let mut noise = Noise::new(seed, "unique id");
        let (low, high) = (noise.bits().to_le_bytes(), noise.bits().to_le_bytes());
        let unique_id = core::array::from_fn(|i| if i < 8 { low[i] } else { high[i - 8] });
        Ok(Self { chip, unique_id })
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
        vec![Target::new("stm32f427", &mut self.chip, core)]
    }
}
