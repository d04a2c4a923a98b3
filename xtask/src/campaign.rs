//! The long tests on the emulated board: those of `hil-sim/board/tests/it` with more of everything, once per seed.

use anyhow::Result;

use crate::{
    firmware,
    run::{cargo, finish, step},
};

/// What `cargo xtask campaign` can be told.
#[derive(clap::Args)]
pub struct Arguments {
    /// How many rigs, each with its own mechanics: seeds 1, 2, 3 ...
    #[arg(long, default_value_t = 3)]
    seeds: u64,
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
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<()> {
    let elf = firmware::build()?;
    for seed in 1..=arguments.seeds {
        step(&format!("campaign, seed {seed}"));
        let mut command = cargo(["test", "--locked", "--package", "farnear-sim", "--test", "it"]);
        command
            .args(["--", "steps::", "accuracy::", "memory::", "fuzz::", "--nocapture", "--test-threads", "2"])
            .env("FARNEAR_FIRMWARE", &elf)
            .env("FARNEAR_CAMPAIGN", "1")
            .env("FARNEAR_SEED", seed.to_string())
            .env("FARNEAR_MOVES", arguments.moves.to_string())
            .env("FARNEAR_STEPS", arguments.steps.to_string())
            .env("FARNEAR_FUZZ_FRAMES", arguments.fuzz_frames.to_string());
        finish(&mut command)?;
    }
    step("campaign, hostile frames");
    let mut command = cargo(["test", "--locked", "--package", "farnear-rig", "--test", "it"]);
    command
        .args(["--", "hostile::", "--nocapture"])
        .env("FARNEAR_HOSTILE_FRAMES", arguments.hostile_frames.to_string());
    finish(&mut command)
}
