use std::path::PathBuf;

use crate::{parts::Parts, scenario::Scenario};

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Pace {
    /// Time passes only on request.
    #[default]
    OnRequest,
    /// Time also passes while the board has an answer or event outstanding.
    Lockstep,
    /// Follows the wall clock while the board is busy or a host was recently active.
    Realtime,
}

#[derive(Clone, Debug)]
pub struct RigConfig {
    /// Firmware ELF; `None` searches ([`crate::firmware::find`]).
    pub firmware: Option<PathBuf>,
    /// Seed of mechanics, noise, jitter, unique id and line faults.
    pub seed: u64,
    pub parts: Parts,
    /// Cycle cost per instruction kind instead of the average: about 100 times slower, for measurements.
    pub costs_by_kind: bool,
    /// Faults. Seed, parts and host steps are applied by the caller ([`RigConfig::of`]).
    pub scenario: Scenario,
    pub pace: Pace,
    /// File of the board's memory, created if missing, saved at the end; `None`: blank memory, not saved.
    pub memory: Option<PathBuf>,
    /// Records line, plant and faults for a campaign's invariants.
    pub observe: bool,
    pub trace: Option<PathBuf>,
}

impl Default for RigConfig {
    fn default() -> Self {
        Self {
            firmware: None,
            seed: 1,
            parts: Parts::default(),
            costs_by_kind: false,
            scenario: Scenario::default(),
            pace: Pace::OnRequest,
            memory: None,
            observe: false,
            trace: None,
        }
    }
}

impl RigConfig {
    /// The rig of a scenario with its seed (default 1) and parts, in [`Pace::OnRequest`].
    pub fn of(scenario: &Scenario) -> Result<Self, String> {
        Ok(Self {
            seed: scenario.seed.unwrap_or(1),
            parts: scenario.parts()?,
            scenario: scenario.clone(),
            ..Self::default()
        })
    }
}
