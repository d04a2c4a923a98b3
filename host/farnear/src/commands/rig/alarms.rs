//! `farnear rig alarms`: lists what stopped the rig, and clears it.

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::alarms;

use super::Target;
use crate::{report, terminal};

/// List the last alarms, or clear the latched one by its number. While an alarm is latched nothing moves.
#[derive(Args)]
#[command(after_help = "Example: farnear rig alarms --port /dev/ttyACM0 --clear 3")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Clear the latched alarm; refused while its cause is there.
    #[arg(long, value_name = "NUMBER")]
    clear: Option<u32>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { target, clear, json } = arguments;
    report::print(&alarms::alarms(&target.address()?, clear, &terminal::context()?)?, json)
}
