//! `farnear rig info`: who is there and how it is.

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::info;

use super::Target;
use crate::{report, terminal};

/// Say who the board is, how far it goes and where it stands.
#[derive(Args)]
#[command(after_help = "Example: farnear rig info --port /dev/ttyACM0")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    report::print(&info::info(&arguments.target.address()?, &terminal::context()?)?, arguments.json)
}
