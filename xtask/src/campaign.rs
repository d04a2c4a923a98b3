//! Campaigns on the emulated board: random scenarios, and the long versions of `hil-sim/board/tests/it`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::{
    firmware,
    run::{cargo, finish, step},
};

/// Options of `cargo xtask campaign`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Number of random scenarios, each with a rig, a host and faults: seeds 1, 2, 3 ...
    #[arg(long, default_value_t = 100)]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Use only a part of the seeds, e.g. 2/8 for the second of eight machines, and run no other tests.
    #[arg(long)]
    shard: Option<String>,
    /// Folder for the shrunk scenarios of violations.
    #[arg(long, default_value = "out/campaign")]
    out: PathBuf,
    /// Play only scenarios, without the long tests.
    #[arg(long)]
    scenarios_only: bool,
    /// Number of rigs for the long tests, each with its own mechanics.
    #[arg(long, default_value_t = 3)]
    rigs: u64,
    /// Random moves of each axis on each rig.
    #[arg(long, default_value_t = 1_000)]
    moves: u32,
    /// Total STEP pulses of both axes at 40 kHz.
    #[arg(long, default_value_t = 1_000_000)]
    steps: u32,
    /// Fuzzed frames on each rig's link.
    #[arg(long, default_value_t = 20_000)]
    fuzz_frames: u64,
    /// Hostile frames (replays, bursts, noise, other hosts) to the rig without the emulator, once for all seeds.
    #[arg(long, default_value_t = 1_000_000)]
    hostile_frames: u64,
    /// Power cuts at random bytes of memory writes, without the emulator.
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
