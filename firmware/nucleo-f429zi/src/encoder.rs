//! Incremental encoder: extends a 16-bit timer of all four edges. Read it every 32,767 counts (0.6 s at 6.25 mm/s).

use embassy_stm32::{
    Peri,
    gpio::Pull,
    timer::{
        Ch1, Ch2, GeneralInstance4Channel, TimerPin,
        qei::{Config, Qei},
    },
};

pub struct Encoder<T: GeneralInstance4Channel> {
    timer: Qei<'static, T>,
    last: u16,
    counts: i32,
}

impl<T: GeneralInstance4Channel> Encoder<T> {
    pub fn new(
        timer: Peri<'static, T>,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let pulled_up = Config { ch1_pull: Pull::Up, ch2_pull: Pull::Up, ..Config::default() };
        let timer = Qei::new::<Ch1, Ch2>(timer, a, b, pulled_up);
        let last = timer.count();
        Self { timer, last, counts: 0 }
    }

    /// Counts since the start, positive = sensor and lens apart.
    pub fn counts(&mut self) -> i32 {
        let count = self.timer.count();
        let moved = count.wrapping_sub(self.last) as i16;
        self.last = count;
        self.counts = self.counts.wrapping_add(i32::from(moved));
        self.counts
    }
}
