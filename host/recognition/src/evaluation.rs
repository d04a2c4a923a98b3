//! How well activities are recognised: leave-one-subject-out with every parameter chosen inside the training subjects, and
//! confusion matrices with intervals, and whether answers are as sure as they should be.

pub mod calibration;
pub mod confusion;
pub mod leave_one_out;
pub mod open_set;
