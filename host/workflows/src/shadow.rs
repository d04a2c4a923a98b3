//! Removal of a person's shadow from masks or video, and its scoring.

pub mod removal;
pub mod score;
mod stages;
pub mod video;
