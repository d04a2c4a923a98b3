use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::log::{self, LogSettings};

use super::Target;
use crate::{report, terminal};

/// Follow the firmware's log. With the firmware's ELF file it is decoded, without it is printed as bytes.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig log --port /dev/ttyACM0 --elf farnear-nucleo-f429zi.elf --reset"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    /// The firmware that runs on the board, for the texts that the log only numbers.
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
    /// End after this time [default: when interrupted].
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Reset the board first, to see how it starts.
    #[arg(long)]
    reset: bool,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { target, elf, seconds, reset } = arguments;
    let settings = LogSettings { rig: target.address()?, elf, seconds, reset };
    let mut print = |line: &str| report::to_stdout(&format!("{line}\n"));
    log::follow(&settings, &mut print, &terminal::context()?)?;
    Ok(())
}
