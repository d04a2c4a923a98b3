//! Leave-one-subject-out evaluation, confusion matrices with intervals, calibration.

pub mod calibration;
pub mod confusion;
pub mod leave_one_out;
pub mod open_set;
