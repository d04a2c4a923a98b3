//! `farnear rig counters | reset`.

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::board;

use super::Target;
use crate::{report, terminal};

/// Print what the board has counted in its life.
#[derive(Args)]
#[command(after_help = "Example: farnear rig counters --port /dev/ttyACM0 --json")]
pub struct CountersArguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Reset the board; the stages have to be homed again afterwards.
#[derive(Args)]
#[command(after_help = "Example: farnear rig reset --port /dev/ttyACM0")]
pub struct ResetArguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs `counters`.
pub fn counters(arguments: CountersArguments) -> Result<()> {
    let address = arguments.target.address()?;
    report::print(&board::counters(&address, &terminal::context()?)?, arguments.json)
}

/// Runs `reset`.
pub fn reset(arguments: ResetArguments) -> Result<()> {
    let address = arguments.target.address()?;
    report::print(&board::reset(&address, &terminal::context()?)?, arguments.json)
}
