//! How well activities are recognised: leave-one-subject-out with every parameter chosen inside the training subjects.

pub mod choice;
pub mod confusion;
pub mod experiment;
pub mod leave_one_out;
pub mod skeleton_clips;
