//! Settled: within a window of the target for a dwell time without interruption. Cost: one division per dwell.

use farnear_protocol::{Nanometres, Settle};

use crate::io::TICK_US;

#[derive(Clone, Debug)]
pub(crate) struct Settling {
    window: Nanometres,
    dwell_ticks: u32,
    inside_ticks: u32,
    /// Sum and length of the current dwell.
    sum: i64,
    summed: u32,
    mean: Nanometres,
    settled: bool,
}

impl Settling {
    /// At least one tick.
    pub(crate) const fn new(settle: Settle) -> Self {
        let dwell_ticks = settle.dwell.0.div_ceil(TICK_US);
        Self {
            window: settle.window,
            dwell_ticks: if dwell_ticks == 0 { 1 } else { dwell_ticks },
            inside_ticks: 0,
            sum: 0,
            summed: 0,
            mean: Nanometres(0),
            settled: false,
        }
    }

    pub(crate) fn push(&mut self, error: Nanometres, position: Nanometres) {
        if error.0.saturating_abs() > self.window.0 {
            return self.interrupt();
        }
        self.sum += i64::from(position.0);
        self.summed += 1;
        // The dwell is between its first and last sample: one sample more than ticks.
        if self.summed > self.dwell_ticks {
            self.mean = Nanometres((self.sum / i64::from(self.summed)) as i32);
            (self.sum, self.summed) = (i64::from(position.0), 1);
        }
        self.settled |= self.inside_ticks >= self.dwell_ticks;
        self.inside_ticks = self.inside_ticks.saturating_add(1);
    }

    /// Restarts: outside the window, or not measured.
    pub(crate) const fn interrupt(&mut self) {
        (self.inside_ticks, self.sum, self.summed, self.settled) = (0, 0, 0, false);
    }

    pub(crate) const fn is_settled(&self) -> bool {
        self.settled
    }

    pub(crate) const fn mean(&self) -> Nanometres {
        self.mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_protocol::Micros;

    #[test]
    fn one_sample_outside_begins_the_dwell_again() {
        let mut settling = Settling::new(Settle { window: Nanometres(50), dwell: Micros(2_000) });
        let mut push = |error: i32| {
            settling.push(Nanometres(error), Nanometres(1_000 + error));
            settling.is_settled()
        };
        assert!((0..10).all(|_| !push(50)), "2 ms are ten ticks after the first sample");
        assert!(push(-50));
        assert!(!push(51));
        assert!((0..10).all(|_| !push(0)));
        assert!(push(0));
        assert_eq!(settling.mean(), Nanometres(1_000));
    }

    #[test]
    fn the_dwell_is_at_least_as_long_as_requested_and_the_window_is_the_same_on_both_sides() {
        for (dwell_us, samples) in [(0, 2), (1, 2), (200, 2), (201, 3), (2_001, 12)] {
            let mut settling = Settling::new(Settle { window: Nanometres(50), dwell: Micros(dwell_us) });
            for sample in 1..=samples {
                assert!(!settling.is_settled(), "{dwell_us} us after {} samples", sample - 1);
                settling.push(Nanometres(0), Nanometres(0));
            }
            assert!(settling.is_settled(), "{dwell_us} us after {samples} samples");
            for outside in [-51, i32::MIN] {
                settling.push(Nanometres(outside), Nanometres(0));
                assert!(!settling.is_settled(), "{outside}");
            }
        }
    }
}
