//! Seeded synthetic data: a jointed body, its walk and the ten activities, and scenes with a shadow whose truth is known.

pub mod activities;
pub mod body;
pub mod pictures;
pub mod scene;
