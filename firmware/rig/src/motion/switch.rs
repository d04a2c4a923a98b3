//! An end switch, believed only when it says the same several times.
//!
//! A contact bounces for most of a millisecond, and a motor's chopper is coupled into its wire: a single sample says nothing.
//! [`SAMPLES`] equal ones in a row do, and the axis was where it changed at the first of them.

use farnear_protocol::Nanometres;

/// Equal samples in a row that are believed: 0.6 ms, in which a stage at full speed goes 4 um.
pub(crate) const SAMPLES: u8 = 3;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Place {
    /// In pulses of the present count.
    pub(crate) position: i32,
    /// By the encoder on the motor's shaft.
    pub(crate) measured: Nanometres,
}

/// A switch.
#[derive(Clone, Debug)]
pub(crate) struct Switch {
    closed: bool,
    seen: bool,
    /// How often in a row it has said the opposite, and where that began.
    opposite: u8,
    began: Place,
    changed: Place,
}

impl Switch {
    /// A switch that was not looked at.
    pub(crate) const fn new() -> Self {
        let nowhere = Place { position: 0, measured: Nanometres(0) };
        Self { closed: false, seen: false, opposite: 0, began: nowhere, changed: nowhere }
    }

    /// Takes a sample; the axis is `at` this place.
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

    /// Whether it is closed.
    pub(crate) const fn is_closed(&self) -> bool {
        self.closed
    }

    /// Whether its last sample said the same.
    pub(crate) const fn is_steady(&self) -> bool {
        self.opposite == 0
    }

    /// Where it changed last.
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
