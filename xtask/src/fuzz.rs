//! Property tests for longer: the same tests, more cases, seeds 1, 2, 3 ... until the time is over.
//!
//! A case that fails is stored by proptest in a `proptest-regressions` file next to its test; commit that file, and the
//! case runs first in every later test run.

use std::time::{Duration, Instant};

use anyhow::Result;

use crate::run::{cargo, finish, step};

/// Crates whose tests read what others send: frames, requests, files.
const CRATES: [&str; 9] = [
    "farnear-protocol",
    "farnear-rig",
    "farnear-capture",
    "farnear-scene",
    "farnear-recognition",
    "farnear-shadow",
    "farnear-silhouettes",
    "farnear-files",
    "farnear-workflows",
];
/// Cases per property and round.
const CASES: &str = "20000";

/// Runs rounds until `seconds` are over; at least one.
pub fn run(seconds: u64) -> Result<()> {
    let until = Instant::now() + Duration::from_secs(seconds);
    for round in 1u64.. {
        step(&format!("fuzzing, round {round}"));
        let mut arguments = vec!["test", "--release", "--locked", "--quiet"];
        arguments.extend(CRATES.iter().flat_map(|name| ["--package", name]));
        finish(cargo(arguments).env("PROPTEST_CASES", CASES).env("PROPTEST_RNG_SEED", round.to_string()))?;
        if Instant::now() >= until {
            break;
        }
    }
    Ok(())
}
