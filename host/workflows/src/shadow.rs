//! Shadow on masks of a person: taking it off by where the sun stands ([`removal`]), and scoring how well any removal did
//! ([`score`]).

pub mod removal;
pub mod score;
