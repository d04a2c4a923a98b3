use std::{
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Result;
use clap::{Args, Parser, Subcommand};
use farnear_campaign::{Campaign, Shard, host_model};
use farnear_sim::{RigConfig, Scenario, cpu_time::cpu_time};

/// Seeded fault campaigns on the emulated board.
#[derive(Parser)]
#[command(version)]
struct Program {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    /// Play random scenarios, one per seed, check the invariants of each, and write the shrunk scenario of each failure.
    /// Exit code 1 if one fails.
    #[command(after_help = "Example:\n  farnear-campaign run --seeds 200 --shard 2/8 --out broken/")]
    Run(Seeds),
    /// Play one scenario file with [[host]] steps and check the invariants.
    #[command(after_help = "Example:\n  farnear-campaign play broken/position-126.toml")]
    Play {
        /// Scenario file (docs/hil.md).
        scenario: PathBuf,
        /// Firmware ELF; default: the one next to this program.
        #[arg(long, value_name = "ELF")]
        firmware: Option<PathBuf>,
        /// Write the true positions to this file: CSV, or a value change dump if it ends in .vcd.
        #[arg(long, value_name = "FILE")]
        trace: Option<PathBuf>,
    },
}

#[derive(Args)]
struct Seeds {
    /// Number of scenarios.
    #[arg(long, default_value_t = 100)]
    seeds: u64,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Only one part of the seeds, e.g. 2/8: for several machines.
    #[arg(long, default_value = "1/1")]
    shard: Shard,
    /// Rigs in parallel; default: the number of cores.
    #[arg(long)]
    jobs: Option<usize>,
    /// Firmware ELF; default: the one next to this program.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Folder for the shrunk scenarios of violations.
    #[arg(long, default_value = "campaign", value_name = "FOLDER")]
    out: PathBuf,
    /// Print the scenario of the first seed without playing it.
    #[arg(long)]
    show: bool,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    let done = match Program::parse().job {
        Job::Run(seeds) => play_seeds(&seeds),
        Job::Play { scenario, firmware, trace } => play_file(&scenario, firmware.as_deref(), trace),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("farnear-campaign: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn play_seeds(seeds: &Seeds) -> Result<()> {
    let mut stdout = std::io::stdout();
    if seeds.show {
        stdout.write_all(farnear_campaign::draw(seeds.first).text().as_bytes())?;
        return Ok(());
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let campaign = Campaign {
        seeds: seeds.first..seeds.first.saturating_add(seeds.seeds),
        shard: seeds.shard,
        jobs: seeds.jobs.unwrap_or(cores),
        firmware: seeds.firmware.clone(),
        out: seeds.out.clone(),
    };
    anyhow::ensure!(
        !campaign.own_seeds().is_empty(),
        "shard {}/{} has none of the {} seeds from {}: expected at least as many seeds as shards; give more --seeds",
        seeds.shard.index,
        seeds.shard.count,
        seeds.seeds,
        seeds.first
    );
    let mut played = 0;
    let summary = farnear_campaign::run(&campaign, |seed, outcome| {
        played += 1;
        if let Some(broken) = outcome.broken.first() {
            eprintln!("seed {seed} breaks {}: {}", broken.property, broken.what);
        }
        if played % 20 == 0 {
            eprintln!("{played} scenarios, {:.0} s of CPU", cpu_time().as_secs_f64());
        }
    })?;
    if seeds.json {
        writeln!(stdout, "{}", summary.json())?;
    } else {
        stdout.write_all(summary.table(cpu_time()).as_bytes())?;
    }
    anyhow::ensure!(
        summary.broken.is_empty(),
        "{} of {} scenarios break a property; play one again: farnear-campaign play FILE",
        summary.broken.len(),
        summary.played
    );
    Ok(())
}

fn play_file(file: &Path, firmware: Option<&Path>, trace: Option<PathBuf>) -> Result<()> {
    let scenario = Scenario::read(file)?;
    anyhow::ensure!(
        !scenario.host.is_empty(),
        "{} has no [[host]] steps: run it with `farnear-sim run --scenario FILE` and a client",
        file.display()
    );
    let config = RigConfig::of(&scenario).map_err(anyhow::Error::msg)?;
    let config = RigConfig { firmware: firmware.map(Into::into), trace, ..config };
    let outcome = host_model::play(&scenario, &config)?;
    let mut stdout = std::io::stdout();
    writeln!(
        stdout,
        "{:.3} s of the board's time: {} requests answered, {} works done and {} failed, {} alarms, {} exposures, {} resets",
        outcome.board_ns as f64 * 1e-9,
        outcome.counts.answered,
        outcome.counts.done,
        outcome.counts.failed,
        outcome.counts.alarms,
        outcome.counts.exposures,
        outcome.resets
    )?;
    for broken in &outcome.broken {
        writeln!(
            stdout,
            "broken at {:.6} s: {}: {}",
            broken.at_ns as f64 * 1e-9,
            broken.property,
            broken.what
        )?;
    }
    anyhow::ensure!(outcome.broken.is_empty(), "{} properties are violated", outcome.broken.len());
    writeln!(stdout, "every property holds")?;
    Ok(())
}
