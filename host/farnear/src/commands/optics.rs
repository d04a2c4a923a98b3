//! `farnear optics`: the working range of a pair.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::optics;

use crate::report;

/// Print the working range: what far and near focus mean in mm, and how far the sensor moves.
#[derive(Args)]
#[command(after_help = "Example: farnear optics --optics optics.toml --json")]
pub struct Arguments {
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    report::print(&optics::read(&arguments.optics)?.working_range(), arguments.json)
}
