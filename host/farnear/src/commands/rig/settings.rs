//! `farnear rig settings`: what the board keeps in its memory.

use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use farnear_protocol::message::{Setting, SettingKey};
use serde::Serialize;

use super::Target;
use crate::report::{self, Usage};

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

#[derive(Serialize)]
struct Entry {
    key: &'static str,
    value: i32,
    default: i32,
    min: i32,
    max: i32,
}

impl From<Setting> for Entry {
    fn from(setting: Setting) -> Self {
        let Setting { key, value, default, min, max } = setting;
        Self { key: key.name(), value, default, min, max }
    }
}

#[derive(Serialize)]
struct All {
    settings: Vec<Entry>,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::List(arguments) => {
            let rig = arguments.target.connect(None)?;
            let settings = SettingKey::ALL.iter().map(|key| Ok(rig.client.setting(*key)?.into()));
            report::print(&All { settings: settings.collect::<Result<_>>()? }, arguments.json)
        }
        Job::Get(arguments) => {
            let key = key(&arguments.key)?;
            let rig = arguments.target.connect(None)?;
            report::print(&Entry::from(rig.client.setting(key)?), arguments.json)
        }
        Job::Set(arguments) => {
            let key = key(&arguments.key)?;
            let rig = arguments.target.connect(None)?;
            report::print(&Entry::from(rig.client.set_setting(key, arguments.value)?), arguments.json)
        }
    }
}

fn key(name: &str) -> Result<SettingKey> {
    let found = SettingKey::ALL.into_iter().find(|key| key.name() == name);
    let names = || SettingKey::ALL.map(SettingKey::name).join(", ");
    found.with_context(|| Usage(format!("there is no setting {name:?}; there are {}", names())))
}
