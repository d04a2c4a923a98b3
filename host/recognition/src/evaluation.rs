//! Evaluation: leave-one-subject-out with parameters chosen inside the training subjects, confusion matrices
//! with intervals, calibration.

pub mod calibration;
pub mod confusion;
pub mod leave_one_out;
pub mod open_set;
