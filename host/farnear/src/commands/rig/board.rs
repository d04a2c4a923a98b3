//! `farnear rig counters | reset`.

use anyhow::Result;
use clap::Args;
use farnear_capture::describe::{alarm_text, cause_name};
use serde::Serialize;

use super::Target;
use crate::report;

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

#[derive(Serialize)]
struct Counters {
    boots: u32,
    alarms: u32,
    triggers: u64,
    coarse_steps: u64,
    lens_steps: u64,
    homings: u32,
    repaired_records: u32,
}

#[derive(Serialize)]
struct Reset {
    boot_before: u32,
    boot: u32,
    cause: &'static str,
    alarm: u32,
}

/// Runs `counters`.
pub fn counters(arguments: CountersArguments) -> Result<()> {
    let counters = arguments.target.connect(None)?.client.counters()?;
    let figures = Counters {
        boots: counters.boots,
        alarms: counters.alarms,
        triggers: counters.triggers,
        coarse_steps: counters.coarse_steps,
        lens_steps: counters.lens_steps,
        homings: counters.homings,
        repaired_records: counters.repaired,
    };
    report::print(&figures, arguments.json)
}

/// Runs `reset`.
pub fn reset(arguments: ResetArguments) -> Result<()> {
    let mut rig = arguments.target.connect(None)?;
    let boot_before = rig.client.hello().boot;
    rig.client.reboot()?;
    let alarm = rig.client.status()?.alarm;
    if let Some(record) = alarm {
        eprintln!("alarm {} is latched: {}", record.number, alarm_text(record.alarm));
    }
    let hello = rig.client.hello();
    let figures = Reset {
        boot_before,
        boot: hello.boot,
        cause: cause_name(hello.reset_cause),
        alarm: alarm.map_or(0, |record| record.number),
    };
    report::print(&figures, arguments.json)
}
