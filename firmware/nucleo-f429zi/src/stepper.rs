//! STEP pulses from TIM1, exactly as many as ordered.
//!
//! TIM1 runs in one-pulse mode: it plays one [`Segment`] from its repetition counter and stops by itself at the
//! update event, so no late interrupt can ever add a pulse. The update interrupt, the highest of the program,
//! loads the waiting segment and starts the timer again; that takes well under a microsecond, which the motor's
//! spacing absorbs (at least 25 us). STEP is low for the first half of a period and high for the second.
//!
//! DIR, EN and DIAG are the driver chip's other lines (TMC2209 class: EN is active low, DIAG active high).

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::{
    Peri,
    gpio::{Input, Level, Output, OutputType, Pull, Speed},
    interrupt,
    interrupt::{Interrupt, Priority},
    pac::{self, timer::vals},
    peripherals::{PE9, PF13, PF14, PF15, TIM1},
    rcc,
    timer::{Ch1, simple_pwm::PwmPin},
};
use farnear_rig::io::{Outputs, STEP_TIMER_HZ, Segment, StepperState};
use heapless::Deque;

use crate::{clock::APB2_TIMER_HZ, registers};

/// Segments that can wait: at least 8 ms of motion at the longest, two ticks' worth at the shortest.
const QUEUE: usize = 8;
const PRESCALER: u16 = (APB2_TIMER_HZ / STEP_TIMER_HZ - 1) as u16;

struct Queue {
    waiting: Deque<Segment, QUEUE>,
    running: Option<Segment>,
    pulses: u32,
    underrun: bool,
}

static STEPS: Mutex<RefCell<Queue>> =
    Mutex::new(RefCell::new(Queue { waiting: Deque::new(), running: None, pulses: 0, underrun: false }));

impl Queue {
    /// Starts the next segment. Only while the timer stands.
    fn start_next(&mut self) {
        self.running = self.waiting.pop_front();
        let Some(segment) = self.running else { return };
        let timer = pac::TIM1;
        timer.arr().write(|w| w.set_arr(segment.period_ticks - 1));
        timer.ccr(0).write(|w| w.set_ccr(segment.period_ticks / 2));
        timer.rcr().write(|w| w.set_rep(segment.pulses - 1));
        // Takes the three into the working registers; makes no flag (URS) and no edge (the count is 0 already).
        timer.egr().write(|w| w.set_ug(true));
        timer.cr1().modify(|w| w.set_cen(true));
    }
}

#[interrupt]
fn TIM1_UP_TIM10() {
    pac::TIM1.sr().modify(|w| w.set_uif(false));
    critical_section::with(|cs| {
        let mut steps = STEPS.borrow_ref_mut(cs);
        let Some(ended) = steps.running else { return };
        steps.pulses = steps.pulses.wrapping_add(u32::from(ended.pulses));
        steps.start_next();
        steps.underrun |= steps.running.is_none() && !ended.last;
    });
}

/// The coarse axis' motor.
pub struct Stepper {
    direction: Output<'static>,
    enable: Output<'static>,
    diagnosis: Input<'static>,
    _step: PwmPin<'static, TIM1, Ch1>,
}

impl Stepper {
    /// Sets the timer and the pins up; the driver is off.
    pub fn new(
        _timer: Peri<'static, TIM1>,
        step: Peri<'static, PE9>,
        direction: Peri<'static, PF13>,
        enable: Peri<'static, PF14>,
        diagnosis: Peri<'static, PF15>,
    ) -> Self {
        rcc::enable_and_reset::<TIM1>();
        let timer = pac::TIM1;
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
        // The working registers first, then the output: otherwise it would come up high and give one edge.
        timer.egr().write(|w| w.set_ug(true));
        timer.ccer().write(|w| w.set_cce(0, true));
        timer.bdtr().write(|w| w.set_moe(true));
        timer.dier().write(|w| w.set_uie(true));
        registers::enable_interrupt(Interrupt::TIM1_UP_TIM10, Priority::P0);
        Self {
            direction: Output::new(direction, Level::Low, Speed::Low),
            enable: Output::new(enable, Level::High, Speed::Low),
            diagnosis: Input::new(diagnosis, Pull::Down),
            _step: PwmPin::new(step, OutputType::PushPull),
        }
    }

    /// What the timer is doing.
    pub fn state(&self) -> StepperState {
        critical_section::with(|cs| {
            let steps = STEPS.borrow_ref(cs);
            StepperState {
                pulses: steps.pulses,
                idle: steps.running.is_none() && steps.waiting.is_empty(),
                underrun: steps.underrun,
                room: (QUEUE - steps.waiting.len()) as u8,
            }
        })
    }

    /// The driver chip reports a fault.
    pub fn fault(&self) -> bool {
        self.diagnosis.is_high()
    }

    /// Carries out the orders of one tick.
    pub fn apply(&mut self, outputs: &Outputs) {
        self.enable.set_level((!outputs.enable).into());
        self.direction.set_level(outputs.direction_away.into());
        critical_section::with(|cs| {
            let mut steps = STEPS.borrow_ref_mut(cs);
            if outputs.abort_steps {
                steps.waiting.clear();
                steps.underrun = false;
                // What runs ends by itself within a millisecond, and that is no underrun.
                if let Some(running) = &mut steps.running {
                    running.last = true;
                }
            }
            for segment in &outputs.segments {
                if steps.waiting.push_back(*segment).is_err() {
                    // More than `room`: stop rather than lose pulses silently.
                    steps.waiting.clear();
                    steps.underrun = true;
                }
            }
            if steps.running.is_none() && !steps.underrun {
                steps.start_next();
            }
        });
    }
}
