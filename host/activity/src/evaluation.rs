//! How well activities are recognised: leave-one-subject-out with every parameter chosen inside the training subjects, and
//! confusion matrices with intervals.

pub mod confusion;
pub mod leave_one_out;
