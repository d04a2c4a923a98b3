//! Pins of the board, and its implementation of [`farnear_rig::control::Board`].

use defmt::{error, info, warn};
use embassy_stm32::{
    Peri, Peripherals,
    gpio::{Input, Pull},
    peripherals::{IWDG, PB0, TIM1, TIM3, TIM4, TIM8},
    usart::ConfigError,
    wdg::IndependentWatchdog,
};
use farnear_protocol::{BoardMicros, Log, message::LinkRate};
use farnear_rig::{
    control::{Board, Note},
    io::{ExposureEdges, MotorInputs, Outputs, StrobeEdges, Trigger},
};

use crate::{
    axis::{Axis, Switches},
    camera::CameraPort,
    clock,
    encoder::Encoder,
    light::LightPort,
    link::Link,
    memory::Memory,
    piezo::Piezo,
    registers,
    stepper::{DriverPins, Stepper},
    supply::Supply,
};

/// Watchdog timeout without a tick (LSI is 17 to 47 kHz, so 68 to 188 ms).
const WATCHDOG_US: u32 = 100_000;

pub struct Nucleo {
    pub coarse: Axis<TIM1, TIM4>,
    lens: Axis<TIM8, TIM3>,
    piezo: Piezo,
    camera: CameraPort,
    lights: LightPort,
    /// FRAM; `None` if it does not answer.
    pub memory: Option<Memory>,
    supply: Supply,
    link: Link,
    watchdog: IndependentWatchdog<'static, IWDG>,
}

/// The board, and parts outside the control loop.
pub struct Parts {
    pub board: Nucleo,
    /// Blinks while the loop runs.
    pub led: Peri<'static, PB0>,
    pub emulated: bool,
}

impl Nucleo {
    /// Drivers off, trigger low, watchdog stopped. One long function because it is a table of pins.
    pub fn set_up(p: Peripherals) -> Result<Parts, ConfigError> {
        let emulated = Input::new(p.PD15, Pull::Down).is_high();
        let link = Link::open(p.USART3, p.PD8, p.PD9)?;
        let coarse =
            DriverPins { step: p.PE9, direction: p.PF13, enable: p.PF14, diagnosis: p.PF15, stop: p.PE15 };
        let lens = DriverPins { step: p.PC6, direction: p.PF0, enable: p.PF1, diagnosis: p.PF2, stop: p.PA6 };
        let board = Self {
            memory: Some(Memory::new(p.SPI4, p.PE2, p.PE5, p.PE6, p.PE4)),
            coarse: Axis {
                stepper: Stepper::new(p.TIM1, coarse),
                encoder: Encoder::new(p.TIM4, p.PD12, p.PD13),
                switches: Switches::new(p.PG0, p.PG1),
            },
            lens: Axis {
                stepper: Stepper::new(p.TIM8, lens),
                encoder: Encoder::new(p.TIM3, p.PB4, p.PB5),
                switches: Switches::new(p.PG2, p.PG3),
            },
            piezo: Piezo::new(p.SPI3, p.PC10, p.PC11, p.PC12, p.PD0, p.PD1),
            camera: CameraPort::new(p.TIM2, p.PB10, p.PB11),
            lights: LightPort::new(p.TIM12, p.PB14, p.PB15),
            supply: Supply::new(),
            link,
            watchdog: IndependentWatchdog::new(p.IWDG, WATCHDOG_US),
        };
        Ok(Parts { board, led: p.PB0, emulated })
    }

    pub const fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    pub fn expose(&mut self, order: Trigger) {
        self.camera.expose(order);
    }

    pub fn wake_watchdog(&mut self) {
        self.watchdog.unleash();
    }
}

impl Board for Nucleo {
    fn now(&mut self) -> BoardMicros {
        clock::now()
    }

    fn receive(&mut self, take: impl FnMut(u8)) -> bool {
        self.link.drain(take)
    }

    fn sample_gauge(&mut self) {
        self.piezo.sample();
    }

    fn gauge(&mut self) -> Option<u32> {
        self.piezo.gauge()
    }

    fn coarse(&mut self) -> MotorInputs {
        self.coarse.read()
    }

    fn lens(&mut self) -> MotorInputs {
        self.lens.read()
    }

    fn emergency_stop(&mut self) -> bool {
        // Both are read, because reading clears the flag.
        let [coarse, lens] = [self.coarse.stepper.emergency_stop(), self.lens.stepper.emergency_stop()];
        coarse || lens
    }

    fn supply_low(&mut self) -> bool {
        self.supply.is_low()
    }

    fn memory_failed(&mut self) -> bool {
        self.memory.as_mut().is_some_and(Memory::take_failure)
    }

    fn exposure(&mut self, now: BoardMicros) -> Option<ExposureEdges> {
        self.camera.take_edges(now)
    }

    fn strobe(&mut self, now: BoardMicros) -> Option<StrobeEdges> {
        self.camera.take_strobe(now)
    }

    fn apply(&mut self, outputs: &Outputs) {
        if let Some(code) = outputs.piezo_dac {
            self.piezo.set(code);
        }
        self.coarse.apply(&outputs.coarse);
        self.lens.apply(&outputs.lens);
        self.lights.set(outputs.lights);
        if outputs.cancel_flash {
            self.camera.cancel_flash();
        }
        self.camera.listen(outputs.listen);
        if let Some(trigger) = outputs.trigger {
            self.expose(trigger);
        }
        if let (Some(memory), Some(order)) = (&mut self.memory, &outputs.memory) {
            memory.write(order);
        }
    }

    fn has_room(&self) -> bool {
        self.link.has_room()
    }

    fn send(&mut self, bytes: &[u8]) {
        self.link.send(bytes);
    }

    fn all_sent(&self) -> bool {
        self.link.is_idle()
    }

    fn set_link_rate(&mut self, rate: LinkRate) {
        self.link.set_rate(rate);
    }

    fn take_log(&mut self) -> Option<(u32, Log)> {
        registers::take_log()
    }

    fn note(&mut self, note: Note) {
        match note {
            Note::StepQueueDry { time } => error!("a STEP queue ran dry at {} us", time.0),
            Note::Reset => info!("reset on request"),
            Note::Alarm(record) => error!("alarm {}: {}", record.number, record.alarm),
            Note::AlarmCleared { number } => info!("alarm {} is cleared", number),
            Note::Refused { request, error } => warn!("request {} is refused: {}", request, error),
            Note::Position { axis, state } => info!("position of {}: {}", axis, state),
            Note::Session { request } => info!("a session is opened by request {}", request),
            Note::LinkRate(rate) => info!("the link rate is now {} baud", rate.baud()),
        }
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.pet();
    }

    fn reset(&mut self) {
        cortex_m::peripheral::SCB::sys_reset()
    }
}
