//! Motion of the stages: two steppers and a piezo, moves, homing.

pub(crate) mod axis;
pub(crate) mod home;
pub(crate) mod leg;
pub(crate) mod positioning;
mod ramp;
pub(crate) mod settling;
pub(crate) mod stage;
pub(crate) mod steps;
pub(crate) mod switch;

use farnear_protocol::{BoardMicros, Micros};

/// Elapsed time; saturates.
pub(crate) fn since(earlier: BoardMicros, now: BoardMicros) -> Micros {
    Micros(u32::try_from(now.0.saturating_sub(earlier.0)).unwrap_or(u32::MAX))
}
