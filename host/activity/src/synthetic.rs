//! Seeded synthetic data: a jointed body, its walk and the ten activities, everyday activities to learn from, recorded motion before
//! the same cameras, damaged masks, and scenes with a shadow whose truth is known.

pub mod activities;
pub mod body;
pub mod damage;
pub mod everyday;
pub mod pictures;
pub mod recorded;
pub mod scene;
