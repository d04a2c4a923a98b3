//! Seeded clips to learn from: the ten activities, everyday activities, and recorded motion drawn from any view.

pub mod activities;
pub mod everyday;
pub mod recorded;
