//! When a position counts as reached: the usual numbers, in one place for board and host.
//!
//! A wider window or a shorter dwell trades accuracy for time; each purpose is a multiple of what a move asks for, so that
//! to change the piezo's window is to change one number here.

use crate::message::Axis;
use crate::units::{Micros, Nanometres};

/// A position has settled when it was measured within a window of its target for a while without a break.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Settle {
    /// Largest distance from the target.
    pub window: Nanometres,
    /// For so long.
    pub dwell: Micros,
}

/// The piezo's window: 50 nm of sensor travel are 0.02 mm of depth at most, and 16 times the gauge's noise.
const PIEZO: Nanometres = Nanometres(50);
/// A stepper's window: an encoder count and a microstep leave 0.2 um, 1 um is what the axis promises.
const STEPPER: Nanometres = Nanometres(1_000);
/// Ten control ticks, so that a swing of the piezo (200 Hz) through its target does not count.
const DWELL: Micros = Micros(2_000);

impl Settle {
    /// Of a move, and of both images of a pair.
    pub const fn of_move(axis: Axis) -> Self {
        let window = match axis {
            Axis::SensorCoarse | Axis::Lens => STEPPER,
            Axis::SensorFine => PIEZO,
        };
        Self { window, dwell: DWELL }
    }

    /// Of a shot in a sequence of many, where nothing else is asked for.
    pub const fn of_shot(axis: Axis) -> Self {
        match axis {
            Axis::SensorCoarse | Axis::Lens => Self::of_move(axis),
            Axis::SensorFine => Self::of_move(axis).wider(2),
        }
    }

    /// Of the images that only tell about where the focus lies.
    pub const fn of_search(axis: Axis) -> Self {
        match axis {
            Axis::SensorCoarse | Axis::Lens => Self::of_move(axis).wider(2).briefly(),
            Axis::SensorFine => Self::of_move(axis).wider(10).briefly(),
        }
    }

    /// Of the images of a sweep through the focus: a twentieth of the accuracy that is promised.
    pub const fn of_sweep(axis: Axis) -> Self {
        Self::of_shot(axis).briefly()
    }

    const fn wider(self, times: i32) -> Self {
        Self { window: Nanometres(self.window.0 * times), ..self }
    }

    const fn briefly(self) -> Self {
        Self { dwell: Micros(self.dwell.0 / 2), ..self }
    }
}
