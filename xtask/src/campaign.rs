//! Campaigns on the emulated board: seeded random scenarios, and the long versions of
//! `hil-sim/board/tests/it`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::{
    firmware,
    run::{cargo, finish, step},
};

/// Options of `cargo xtask campaign`.
#[derive(clap::Args)]
pub struct Arguments {
    /// How many random scenarios, each a rig, a host and what happens to them: seeds 1, 2, 3 ...
    #[arg(long, default_value_t = 100)]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Only a part of the seeds, e.g. 2/8, the second of eight: for several machines. No other tests run then.
    #[arg(long)]
    shard: Option<String>,
    /// Where the small scenarios are written that break a property.
    #[arg(long, default_value = "out/campaign")]
    out: PathBuf,
    /// No long tests, only scenarios.
    #[arg(long)]
    scenarios_only: bool,
    /// How many rigs the long tests run on, each with its own mechanics.
    #[arg(long, default_value_t = 3)]
    rigs: u64,
    /// Random moves of each axis on each rig.
    #[arg(long, default_value_t = 1_000)]
    moves: u32,
    /// STEP pulses at 40 kHz on both axes together.
    #[arg(long, default_value_t = 1_000_000)]
    steps: u32,
    /// Frames with which each rig's link is fuzzed.
    #[arg(long, default_value_t = 20_000)]
    fuzz_frames: u64,
    /// Hostile frames (replays, bursts, noise, other hosts) for the rig's behaviour without the emulator, once for all seeds.
    #[arg(long, default_value_t = 1_000_000)]
    hostile_frames: u64,
    /// Power cuts at random bytes that are written to the memory, without the emulator.
    #[arg(long, default_value_t = 10_000)]
    power_cuts: u64,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let elf = firmware::build()?;
    // Print the scenarios' table even if both fail.
    let scenarios = scenarios(arguments, &elf);
    if arguments.shard.is_some() || arguments.scenarios_only {
        return scenarios;
    }
    long_tests(arguments, &elf)?;
    scenarios
}

fn scenarios(arguments: &Arguments, elf: &Path) -> Result<()> {
    step(&format!("campaign, {} scenarios", arguments.seeds));
    let mut command = cargo(["run", "--locked", "--package", "farnear-campaign", "--", "run"]);
    command
        .args(["--seeds", &arguments.seeds.to_string(), "--first", &arguments.first.to_string()])
        .args(["--shard", arguments.shard.as_deref().unwrap_or("1/1")])
        .arg("--firmware")
        .arg(elf)
        .arg("--out")
        .arg(&arguments.out);
    finish(&mut command)
}

/// Once per rig, and those without the emulator.
fn long_tests(arguments: &Arguments, elf: &Path) -> Result<()> {
    for seed in 1..=arguments.rigs {
        step(&format!("campaign, rig {seed}"));
        let mut command = cargo(["test", "--locked", "--package", "farnear-sim", "--test", "it"]);
        command
            .args(["--", "steps::", "accuracy::", "memory::", "fuzz::", "--nocapture", "--test-threads", "2"])
            .env("FARNEAR_FIRMWARE", elf)
            .env("FARNEAR_CAMPAIGN", "1")
            .env("FARNEAR_SEED", seed.to_string())
            .env("FARNEAR_MOVES", arguments.moves.to_string())
            .env("FARNEAR_STEPS", arguments.steps.to_string())
            .env("FARNEAR_FUZZ_FRAMES", arguments.fuzz_frames.to_string());
        finish(&mut command)?;
    }
    step("campaign, hostile frames and power cuts");
    let mut command = cargo(["test", "--locked", "--package", "farnear-rig", "--test", "it"]);
    command
        .args(["--", "hostile::", "power_cuts::", "--nocapture"])
        .env("FARNEAR_POWER_CUTS", arguments.power_cuts.to_string())
        .env("FARNEAR_HOSTILE_FRAMES", arguments.hostile_frames.to_string());
    finish(&mut command)
}
