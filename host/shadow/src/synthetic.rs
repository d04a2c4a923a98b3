//! Seeded scenes and pictures with known shadow.

pub mod pictures;
pub mod scene;
