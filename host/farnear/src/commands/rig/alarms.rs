//! `farnear rig alarms`: lists what stopped the rig, and clears it.

use anyhow::Result;
use clap::Args;
use farnear_capture::describe::alarm_text;
use serde::Serialize;

use super::Target;
use crate::report;

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

#[derive(Serialize)]
struct Figures {
    /// Number of the latched alarm; 0 = none.
    latched: u32,
    alarms: Vec<Entry>,
}

#[derive(Serialize)]
struct Entry {
    number: u32,
    boot: u32,
    time_s: f64,
    text: String,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let rig = arguments.target.connect(None)?;
    if let Some(number) = arguments.clear {
        rig.client.clear_alarm(number)?;
        eprintln!("alarm {number} is cleared; a stage that moved has lost its position: home it again");
    }
    let latched = rig.client.status()?.alarm.map_or(0, |record| record.number);
    let alarms = rig.client.alarms()?.into_iter().map(|record| Entry {
        number: record.number,
        boot: record.boot,
        time_s: record.time.0 as f64 / 1e6,
        text: alarm_text(record.alarm),
    });
    report::print(&Figures { latched, alarms: alarms.collect() }, arguments.json)
}
