//! `farnear rig settings`: what the board keeps in its memory.

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::rig::settings;

use super::Target;
use crate::{report, terminal};

/// List, read or change the settings in the board's memory.
#[derive(Args)]
#[command(after_help = "Example: farnear rig settings list --port /dev/ttyACM0")]
pub struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    List(ListArguments),
    Get(GetArguments),
    Set(SetArguments),
}

/// List all settings with their defaults and what they may be.
#[derive(Args)]
#[command(after_help = "Example: farnear rig settings list --port /dev/ttyACM0 --json")]
struct ListArguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Read one setting.
#[derive(Args)]
#[command(after_help = "Example: farnear rig settings get coarse_backlash_nm --port /dev/ttyACM0")]
struct GetArguments {
    /// Its name, as the list has it.
    key: String,
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Change a setting, now and for later boots; outside its range it is refused.
#[derive(Args)]
#[command(after_help = "Example: farnear rig settings set coarse_backlash_nm 4000 --port /dev/ttyACM0")]
struct SetArguments {
    /// Its name, as the list has it.
    key: String,
    /// Its new value, in the unit of its name.
    #[arg(allow_negative_numbers = true)]
    value: i32,
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::List(ListArguments { target, json }) => {
            report::print(&settings::list(&target.address()?, &terminal::context()?)?, json)
        }
        Job::Get(GetArguments { key, target, json }) => {
            let key = settings::key(&key)?;
            report::print(&settings::get(&target.address()?, key, &terminal::context()?)?, json)
        }
        Job::Set(SetArguments { key, value, target, json }) => {
            let key = settings::key(&key)?;
            report::print(&settings::set(&target.address()?, key, value, &terminal::context()?)?, json)
        }
    }
}
