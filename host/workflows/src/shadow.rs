//! Shadow on masks of a person: taking it off by where the sun stands ([`removal`]), also straight from a
//! video ([`video`]), and scoring how well any removal did
//! ([`score`]).

pub mod removal;
pub mod score;
mod stages;
pub mod video;
