//! The coarse axis' incremental encoder: TIM4 counts all four edges of a quadrature period, 16 bits, extended
//! here. Read at least once per 32,767 counts (0.6 s at 6.25 mm/s; the control loop reads every 200 us).

use embassy_stm32::{
    Peri,
    gpio::Pull,
    peripherals::{PD12, PD13, TIM4},
    timer::qei::{Config, Qei},
};

/// The encoder with its extended count.
pub struct Encoder {
    timer: Qei<'static, TIM4>,
    last: u16,
    counts: i32,
}

impl Encoder {
    /// Starts counting at 0, wherever the axis is.
    pub fn new(timer: Peri<'static, TIM4>, a: Peri<'static, PD12>, b: Peri<'static, PD13>) -> Self {
        let pulled_up = Config { ch1_pull: Pull::Up, ch2_pull: Pull::Up, ..Config::default() };
        let timer = Qei::new(timer, a, b, pulled_up);
        let last = timer.count();
        Self { timer, last, counts: 0 }
    }

    /// Counts since the start, positive = away from the lens.
    pub fn counts(&mut self) -> i32 {
        let count = self.timer.count();
        let moved = count.wrapping_sub(self.last) as i16;
        self.last = count;
        self.counts = self.counts.wrapping_add(i32::from(moved));
        self.counts
    }
}
