//! Exact numbers of STEP pulses from an advanced timer: TIM1 for stage A, TIM8 for stage B.
//!
//! One-pulse mode: the timer plays one [`Segment`] from its repetition counter and stops at the update event, so a late
//! interrupt never adds a pulse. The update interrupt, the highest priority, loads the next segment in well under a
//! microsecond; pulses are at least 25 us apart. STEP is low for the first half of a period. The emergency stop is on
//! the break input: hardware takes STEP low, then the break interrupt clears the queue; pulses of the interrupted
//! segment are not counted, as the position is lost. DIR, EN, DIAG as on a TMC2209: EN active low, DIAG active high.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::{
    Peri, PeripheralType,
    gpio::{AfType, Flex, Input, Level, Output, OutputType, Pin, Pull, Speed},
    interrupt,
    interrupt::{Interrupt, Priority},
    pac::{
        self,
        timer::{TimAdv, vals},
    },
    peripherals::{TIM1, TIM8},
    rcc,
    timer::{AdvancedInstance4Channel, BkIn1, BreakInputPin, Ch1, TimerPin, simple_pwm::PwmPin},
};
use farnear_rig::io::{MotorOutputs, STEP_TIMER_HZ, Segment, StepperState};
use heapless::Deque;

use crate::{clock::APB2_TIMER_HZ, registers};

/// At least 8 ms of the longest segments, two ticks of the shortest.
const QUEUE: usize = 8;
const PRESCALER: u16 = (APB2_TIMER_HZ / STEP_TIMER_HZ - 1) as u16;

struct Queue {
    waiting: Deque<Segment, QUEUE>,
    running: Option<Segment>,
    pulses: u32,
    underrun: bool,
    /// Set by the break input until read.
    broken: bool,
}

pub struct StepTimer {
    registers: TimAdv,
    queue: Mutex<RefCell<Queue>>,
    update: Interrupt,
    brake: Interrupt,
}

static COARSE: StepTimer = StepTimer::new(pac::TIM1, Interrupt::TIM1_UP_TIM10, Interrupt::TIM1_BRK_TIM9);
static LENS: StepTimer = StepTimer::new(pac::TIM8, Interrupt::TIM8_UP_TIM13, Interrupt::TIM8_BRK_TIM12);

#[interrupt]
fn TIM1_UP_TIM10() {
    COARSE.updated();
}

#[interrupt]
fn TIM8_UP_TIM13() {
    LENS.updated();
}

#[interrupt]
fn TIM1_BRK_TIM9() {
    COARSE.broke();
}

#[interrupt]
fn TIM8_BRK_TIM12() {
    LENS.broke();
}

pub trait StepInstance: AdvancedInstance4Channel {
    fn steps() -> &'static StepTimer;
}

impl StepInstance for TIM1 {
    fn steps() -> &'static StepTimer {
        &COARSE
    }
}

impl StepInstance for TIM8 {
    fn steps() -> &'static StepTimer {
        &LENS
    }
}

impl StepTimer {
    const fn new(registers: TimAdv, update: Interrupt, brake: Interrupt) -> Self {
        let queue = Queue { waiting: Deque::new(), running: None, pulses: 0, underrun: false, broken: false };
        Self { registers, queue: Mutex::new(RefCell::new(queue)), update, brake }
    }

    fn set_up(&self) {
        let timer = self.registers;
        timer.psc().write_value(PRESCALER);
        timer.arr().write(|w| w.set_arr(u16::MAX));
        timer.ccr(0).write(|w| w.set_ccr(u16::MAX));
        timer.cr1().write(|w| {
            w.set_opm(true);
            w.set_urs(vals::Urs::COUNTER_ONLY);
            w.set_arpe(true);
        });
        timer.ccmr_output(0).write(|w| {
            w.set_ocm(0, vals::Ocm::PWM_MODE2);
            w.set_ocpe(0, true);
        });
        // Working registers first, then the output: otherwise it would start high and give one edge.
        timer.egr().write(|w| w.set_ug(true));
        timer.ccer().write(|w| w.set_cce(0, true));
        timer.bdtr().write(|w| {
            // An open circuit (high by the pull-up) takes STEP to its idle level, low.
            w.set_bke(0, true);
            w.set_bkp(0, vals::Bkp::ACTIVE_HIGH);
            w.set_ossi(vals::Ossi::IDLE_LEVEL);
        });
        timer.sr().write(|w| w.0 = 0);
        timer.dier().write(|w| w.set_uie(true));
        registers::enable_interrupt(self.update, Priority::P0);
        registers::enable_interrupt(self.brake, Priority::P0);
    }

    fn with<T>(&self, work: impl FnOnce(&mut Queue) -> T) -> T {
        critical_section::with(|cs| work(&mut self.queue.borrow_ref_mut(cs)))
    }

    fn start_next(&self, queue: &mut Queue) {
        queue.running = queue.waiting.pop_front();
        let Some(segment) = queue.running else { return };
        let timer = self.registers;
        timer.arr().write(|w| w.set_arr(segment.period_ticks - 1));
        timer.ccr(0).write(|w| w.set_ccr(segment.period_ticks / 2));
        timer.rcr().write(|w| w.set_rep(segment.pulses - 1));
        // Loads the working registers without flag (URS) or edge (the count is 0 already).
        timer.egr().write(|w| w.set_ug(true));
        if !timer.bdtr().read().moe() {
            // At the first segment and after an emergency stop; refused by hardware during one.
            timer.bdtr().modify(|w| w.set_moe(true));
            if !timer.bdtr().read().moe() {
                queue.running = None;
                queue.waiting.clear();
                queue.broken = true;
                return;
            }
            timer.sr().write(|w| {
                w.0 = u32::MAX;
                w.set_bif(0, false);
            });
            timer.dier().modify(|w| w.set_bie(true));
        }
        timer.cr1().modify(|w| w.set_cen(true));
    }

    fn updated(&self) {
        self.registers.sr().write(|w| {
            // Flags are cleared by writing 0; ones have no effect.
            w.0 = u32::MAX;
            w.set_uif(false);
        });
        self.with(|queue| {
            let Some(ended) = queue.running else { return };
            queue.pulses = queue.pulses.wrapping_add(u32::from(ended.pulses));
            self.start_next(queue);
            queue.underrun |= queue.running.is_none() && !ended.last && !queue.broken;
        });
    }

    /// The emergency stop has opened; STEP is low already.
    fn broke(&self) {
        self.registers.cr1().modify(|w| w.set_cen(false));
        // The flag stays while the circuit is open, so it is handled once, until the next start.
        self.registers.dier().modify(|w| w.set_bie(false));
        self.registers.sr().write(|w| {
            w.0 = u32::MAX;
            w.set_uif(false);
        });
        self.with(|queue| {
            queue.waiting.clear();
            queue.running = None;
            queue.broken = true;
        });
    }
}

pub struct DriverPins<S, D, E, G, B>
where
    S: PeripheralType + 'static,
    D: PeripheralType + 'static,
    E: PeripheralType + 'static,
    G: PeripheralType + 'static,
    B: PeripheralType + 'static,
{
    pub step: Peri<'static, S>,
    pub direction: Peri<'static, D>,
    pub enable: Peri<'static, E>,
    pub diagnosis: Peri<'static, G>,
    pub stop: Peri<'static, B>,
}

pub struct Stepper<T: StepInstance> {
    direction: Output<'static>,
    enable: Output<'static>,
    /// Last DIR and enable orders: unchanged values are not written, because a port write costs the same.
    away_enabled: (bool, bool),
    diagnosis: Input<'static>,
    stop: Flex<'static>,
    _step: PwmPin<'static, T, Ch1>,
}

impl<T: StepInstance> Stepper<T> {
    pub fn new(
        _timer: Peri<'static, T>,
        pins: DriverPins<impl TimerPin<T, Ch1>, impl Pin, impl Pin, impl Pin, impl BreakInputPin<T, BkIn1>>,
    ) -> Self {
        rcc::enable_and_reset::<T>();
        let function = pins.stop.af_num();
        let mut stop = Flex::new(pins.stop);
        stop.set_as_af_unchecked(function, AfType::input(Pull::Up));
        T::steps().set_up();
        Self {
            direction: Output::new(pins.direction, Level::Low, Speed::Low),
            enable: Output::new(pins.enable, Level::High, Speed::Low),
            away_enabled: (false, false),
            diagnosis: Input::new(pins.diagnosis, Pull::Down),
            stop,
            _step: PwmPin::new(pins.step, OutputType::PushPull),
        }
    }

    pub fn state(&self) -> StepperState {
        T::steps().with(|queue| StepperState {
            pulses: queue.pulses,
            idle: queue.running.is_none() && queue.waiting.is_empty(),
            underrun: queue.underrun,
            room: (QUEUE - queue.waiting.len()) as u8,
        })
    }

    pub fn fault(&self) -> bool {
        self.diagnosis.is_high()
    }

    /// The emergency stop is open, or was since the last call.
    pub fn emergency_stop(&mut self) -> bool {
        let broke = T::steps().with(|queue| core::mem::take(&mut queue.broken));
        broke || self.stop.is_high()
    }

    pub fn apply(&mut self, outputs: &MotorOutputs) {
        let wanted = (outputs.direction_away, outputs.enable);
        if core::mem::replace(&mut self.away_enabled, wanted) != wanted {
            self.enable.set_level((!outputs.enable).into());
            self.direction.set_level(outputs.direction_away.into());
        }
        let timer = T::steps();
        timer.with(|queue| {
            if outputs.abort_steps {
                queue.waiting.clear();
                queue.underrun = false;
                // The running segment ends within a millisecond, which is not an underrun.
                if let Some(running) = &mut queue.running {
                    running.last = true;
                }
            }
            for segment in &outputs.segments {
                if queue.waiting.push_back(*segment).is_err() {
                    // Beyond `room`: stop rather than lose pulses silently.
                    queue.waiting.clear();
                    queue.underrun = true;
                }
            }
            // After a break nothing starts until the loop has read it (`emergency_stop`), and the rig aborts.
            if queue.broken {
                queue.waiting.clear();
            }
            if queue.running.is_none() && !queue.underrun && !queue.broken {
                timer.start_next(queue);
            }
        });
    }
}
