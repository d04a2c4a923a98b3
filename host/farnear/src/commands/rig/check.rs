//! `farnear rig check`: the bring-up checklist, step by step.

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::check::{self, CheckSettings};

use super::{CameraArguments, Target};
use crate::{report, terminal};

/// Walk through the bring-up of a rig: link, identity, memory, switches, emergency stop, encoders, first move, homing,
/// piezo, camera.
///
/// The order is that of docs/bring-up.md: the first half is done with the motors disconnected. Ends with 1 if a step failed.
#[derive(Args)]
#[command(after_help = "Example: farnear rig check --port /dev/ttyACM0 --camera folder:incoming/")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// Only the steps with the motors disconnected: nothing moves.
    #[arg(long)]
    resting_only: bool,
    /// Skip the steps that a person actuates (switches, shafts).
    #[arg(long)]
    no_actuation: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let settings = CheckSettings {
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        resting_only: arguments.resting_only,
        actuation: !arguments.no_actuation,
    };
    let list = check::check(&settings, &terminal::context()?)?;
    report::print(&list, arguments.json)?;
    Ok(list.check()?)
}
