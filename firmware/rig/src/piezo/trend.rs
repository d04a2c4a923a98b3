//! The piezo's disturbance during a rest, when the observer does not run.

/// Disturbance and drift: means of the observer's noisy values over 128 and 1,024 ticks, which lag ramps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trend {
    /// With [`Self::BITS`] more.
    short: i64,
    long: i64,
}

impl Trend {
    pub(super) const BITS: u32 = 16;
    const SHORT: u32 = 7;
    const LONG: u32 = 10;

    pub(super) const fn new(disturbance: i64, drift: i64) -> Self {
        Self { short: disturbance - (drift << Self::SHORT), long: disturbance - (drift << Self::LONG) }
    }

    pub(super) const fn push(&mut self, disturbance: i32) {
        let disturbance = (disturbance as i64) << Self::BITS;
        self.short += (disturbance - self.short) >> Self::SHORT;
        self.long += (disturbance - self.long) >> Self::LONG;
    }

    pub(super) const fn now(self) -> (i64, i64) {
        let drift = (self.short - self.long) / ((1 << Self::LONG) - (1 << Self::SHORT));
        (self.short + (drift << Self::SHORT), drift)
    }
}
