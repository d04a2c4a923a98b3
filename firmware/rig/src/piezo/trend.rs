//! The piezo's disturbance over a rest, in which the observer does not run.

/// Where the disturbance is, and where it goes. The observer's own follow the gauge's noise from tick to tick; over a rest goes on what two
/// means say, of 128 and of 1,024 ticks, of which a ramp is behind by as many ticks' drift.
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

    /// A disturbance and its drift a tick, with [`Self::BITS`] more.
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
