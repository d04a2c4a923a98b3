//! What an emulated rig is made of, and how its time passes.

use std::path::PathBuf;

use crate::{parts::Parts, scenario::Scenario};

/// How virtual time passes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Pace {
    /// Only as long as it is told to.
    #[default]
    Told,
    /// While the board owes an answer or an event, and when told to.
    Lockstep,
    /// With the wall clock, while the board is at work or has just been spoken to.
    Realtime,
}

/// What an emulated rig is made of.
#[derive(Clone, Debug)]
pub struct RigConfig {
    /// The firmware's ELF; `None` looks beside the program and the tests ([`crate::firmware::find`]).
    pub firmware: Option<PathBuf>,
    /// Decides everything random: the mechanics' errors, noise, jitter, the unique id, the line's faults.
    pub seed: u64,
    /// What the parts are like.
    pub parts: Parts,
    /// Each instruction takes what its kind takes, instead of the average: some hundred times slower, for measuring.
    pub costs_by_kind: bool,
    /// What happens to it. Its seed, its parts and its host's steps are the caller's business ([`RigConfig::of`]).
    pub scenario: Scenario,
    pub pace: Pace,
    /// What the board's memory holds at power-on, and where it is kept when the rig ends; a new one is made where there is
    /// none. `None`: a blank memory, which is forgotten.
    pub memory: Option<PathBuf>,
    /// Note what crosses the line, what the plant does and what happens, for the invariants of a campaign.
    pub observe: bool,
    /// Where to write what the plant really did, as CSV.
    pub trace: Option<PathBuf>,
}

impl Default for RigConfig {
    /// Seed 1, the standard parts, no faults, time only when told.
    fn default() -> Self {
        Self {
            firmware: None,
            seed: 1,
            parts: Parts::default(),
            costs_by_kind: false,
            scenario: Scenario::default(),
            pace: Pace::Told,
            memory: None,
            observe: false,
            trace: None,
        }
    }
}

impl RigConfig {
    /// The rig of a scenario, with its own seed (or 1) and parts, whose time passes when told to.
    ///
    /// # Errors
    /// Which number of its parts is wrong.
    pub fn of(scenario: &Scenario) -> Result<Self, String> {
        Ok(Self {
            seed: scenario.seed.unwrap_or(1),
            parts: scenario.parts()?,
            scenario: scenario.clone(),
            ..Self::default()
        })
    }
}
