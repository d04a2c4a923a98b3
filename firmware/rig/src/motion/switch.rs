//! An end switch, filtered against bounce (< 1 ms) and chopper noise: [`SAMPLES`] equal samples count, from the first.

use farnear_protocol::Nanometres;

/// 0.6 ms, in which a stage at full speed moves 4 um.
pub(crate) const SAMPLES: u8 = 3;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Place {
    /// Counted pulses.
    pub(crate) position: i32,
    /// By encoder.
    pub(crate) measured: Nanometres,
}

#[derive(Clone, Debug)]
pub(crate) struct Switch {
    closed: bool,
    seen: bool,
    /// Number of opposite samples in a row, and the position of the first.
    opposite: u8,
    began: Place,
    changed: Place,
}

impl Switch {
    pub(crate) const fn new() -> Self {
        let nowhere = Place { position: 0, measured: Nanometres(0) };
        Self { closed: false, seen: false, opposite: 0, began: nowhere, changed: nowhere }
    }

    pub(crate) fn sample(&mut self, says: bool, at: Place) {
        if !self.seen {
            (self.seen, self.closed) = (true, says);
        }
        if says == self.closed {
            self.opposite = 0;
            return;
        }
        if self.opposite == 0 {
            self.began = at;
        }
        self.opposite += 1;
        if self.opposite >= SAMPLES {
            (self.closed, self.opposite, self.changed) = (says, 0, self.began);
        }
    }

    pub(crate) const fn is_closed(&self) -> bool {
        self.closed
    }

    /// The last sample agrees with the state.
    pub(crate) const fn is_steady(&self) -> bool {
        self.opposite == 0
    }

    pub(crate) const fn changed(&self) -> Place {
        self.changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_false_sample_or_two_change_nothing_and_the_first_of_three_is_the_place() {
        let mut switch = Switch::new();
        let says = [false, true, false, true, true, false, true, true, true, false, true];
        let expected = [false, false, false, false, false, false, false, false, true, true, true];
        for (position, (says, expected)) in (0..).zip(says.into_iter().zip(expected)) {
            switch.sample(says, Place { position, measured: Nanometres(position) });
            assert_eq!(switch.is_closed(), expected, "sample {position}");
        }
        assert_eq!(switch.changed(), Place { position: 6, measured: Nanometres(6) });
    }
}
