//! A seeded jointed body with its walk, and damage to masks.

pub mod body;
pub mod damage;
