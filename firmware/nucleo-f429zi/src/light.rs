//! Outputs for lamp, flash or projector: TIM12 CH1, CH2 (PB14, PB15), PWM of 21 kHz; [`crate::camera`] runs a flash.

use core::cell::Cell;

use critical_section::Mutex;
use embassy_stm32::{
    Peri,
    gpio::OutputType,
    pac::{self, timer::vals},
    peripherals::{PB14, PB15, TIM12},
    rcc,
    timer::{Ch1, Ch2, simple_pwm::PwmPin},
};
use farnear_protocol::message::{LIGHT_LEVEL_MAX, LightLevels};

/// 84 MHz by 4 by 1000: 21 kHz, which no exposure of 1 ms resolves (5 % of a period).
const PRESCALER: u16 = 4 - 1;

/// Levels from [`LightPort::set`], and whether a flash overrides them.
static STEADY: Mutex<Cell<(LightLevels, bool)>> = Mutex::new(Cell::new((LightLevels::OFF, false)));

/// Restarts the counter, so that a period begins with its bright part.
fn put(levels: LightLevels) {
    let timer = pac::TIM12;
    timer.ccr(0).write(|w| w.set_ccr(levels.first));
    timer.ccr(1).write(|w| w.set_ccr(levels.second));
    timer.egr().write(|w| w.set_ug(true));
}

/// Before a reset without control loop, from any interrupt.
pub fn off() {
    put(LightLevels::OFF);
}

pub fn begin_flash(levels: LightLevels) {
    critical_section::with(|cs| {
        let steady = STEADY.borrow(cs);
        steady.set((steady.get().0, true));
        put(levels);
    });
}

pub fn end_flash() {
    critical_section::with(|cs| {
        let steady = STEADY.borrow(cs);
        steady.set((steady.get().0, false));
        put(steady.get().0);
    });
}

pub struct LightPort {
    _first: PwmPin<'static, TIM12, Ch1>,
    _second: PwmPin<'static, TIM12, Ch2>,
}

impl LightPort {
    pub fn new(
        _timer: Peri<'static, TIM12>,
        first: Peri<'static, PB14>,
        second: Peri<'static, PB15>,
    ) -> Self {
        rcc::enable_and_reset::<TIM12>();
        let timer = pac::TIM12;
        timer.psc().write_value(PRESCALER);
        timer.arr().write(|w| w.set_arr(LIGHT_LEVEL_MAX - 1));
        timer.ccmr_output(0).write(|w| {
            w.set_ocm(0, vals::Ocm::PWM_MODE1);
            w.set_ocm(1, vals::Ocm::PWM_MODE1);
        });
        put(LightLevels::OFF);
        timer.ccer().write(|w| {
            w.set_cce(0, true);
            w.set_cce(1, true);
        });
        timer.cr1().write(|w| w.set_cen(true));
        Self {
            _first: PwmPin::new(first, OutputType::PushPull),
            _second: PwmPin::new(second, OutputType::PushPull),
        }
    }

    pub fn set(&mut self, levels: LightLevels) {
        critical_section::with(|cs| {
            let steady = STEADY.borrow(cs);
            let (before, flashes) = steady.get();
            if levels != before {
                steady.set((levels, flashes));
                if !flashes {
                    put(levels);
                }
            }
        });
    }
}
