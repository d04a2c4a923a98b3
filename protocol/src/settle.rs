//! Settle criteria for board and host. A wider window or shorter dwell trades accuracy for time. Each purpose is a
//! multiple of a move's window, so the piezo's window is changed in one place.

use crate::message::Axis;
use crate::units::{Micros, Nanometres};

/// Settled: measured within a window of the target without interruption.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Settle {
    /// Largest distance from the target.
    pub window: Nanometres,
    /// Duration within the window.
    pub dwell: Micros,
}

/// 50 nm of sensor travel is at most 0.02 mm of depth, and 16 times the gauge's noise.
const PIEZO: Nanometres = Nanometres(50);
/// Encoder count and microstep leave 0.2 um; the axis is specified to 1 um.
const STEPPER: Nanometres = Nanometres(1_000);
/// Ten control ticks, so that a 200 Hz swing of the piezo through its target does not count.
const DWELL: Micros = Micros(2_000);

impl Settle {
    /// For a move, and for both images of a pair.
    pub const fn of_move(axis: Axis) -> Self {
        let window = match axis {
            Axis::SensorCoarse | Axis::Lens => STEPPER,
            Axis::SensorFine => PIEZO,
        };
        Self { window, dwell: DWELL }
    }

    /// Default for a shot in a long sequence.
    pub const fn of_shot(axis: Axis) -> Self {
        match axis {
            Axis::SensorCoarse | Axis::Lens => Self::of_move(axis),
            Axis::SensorFine => Self::of_move(axis).wider(2),
        }
    }

    /// For images that only locate the focus.
    pub const fn of_search(axis: Axis) -> Self {
        match axis {
            Axis::SensorCoarse | Axis::Lens => Self::of_move(axis).wider(2).briefly(),
            Axis::SensorFine => Self::of_move(axis).wider(10).briefly(),
        }
    }

    /// For a focus sweep: a twentieth of the specified accuracy.
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
