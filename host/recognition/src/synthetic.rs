//! Seeded training clips: the ten activities, everyday activities, and recorded motion from any view.

pub mod activities;
pub mod everyday;
pub mod recorded;
