//! Seeded scenes and pictures with a shadow whose truth is known.

pub mod pictures;
pub mod scene;
