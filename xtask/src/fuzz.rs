//! Property tests with more cases, seed by seed. Commit a failing test's `proptest-regressions` file: it runs first.

use std::time::{Duration, Instant};

use anyhow::Result;

use crate::run::{cargo, finish, step};

/// Crates whose tests parse foreign data: frames, requests, files.
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
/// Per property and round.
const CASES: &str = "20000";

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
