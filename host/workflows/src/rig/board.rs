use farnear_capture::describe::{alarm_text, cause_name};
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{context::Context, error::Result};

/// Totals over the board's life.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct CounterFigures {
    pub boots: u32,
    pub alarms: u32,
    pub triggers: u64,
    pub coarse_steps: u64,
    pub lens_steps: u64,
    pub homings: u32,
    /// Records with one bad copy.
    pub repaired_records: u32,
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ResetFigures {
    pub boot_before: u32,
    pub boot: u32,
    pub cause: &'static str,
    /// Number of the latched alarm; 0 = none.
    pub alarm: u32,
}

pub fn counters(rig: &RigAddress, context: &Context<'_>) -> Result<CounterFigures> {
    let counters = Rig::connect(rig, None, context)?.client.counters()?;
    Ok(CounterFigures {
        boots: counters.boots,
        alarms: counters.alarms,
        triggers: counters.triggers,
        coarse_steps: counters.coarse_steps,
        lens_steps: counters.lens_steps,
        homings: counters.homings,
        repaired_records: counters.repaired,
    })
}

/// Resets the board; the stages must be homed afterwards.
pub fn reset(rig: &RigAddress, context: &Context<'_>) -> Result<ResetFigures> {
    let mut rig = Rig::connect(rig, None, context)?;
    let boot_before = rig.client.hello().boot;
    rig.client.reboot()?;
    let alarm = rig.client.status()?.alarm;
    if let Some(record) = alarm {
        context.info(&format!("alarm {} is latched: {}", record.number, alarm_text(record.alarm)));
    }
    let hello = rig.client.hello();
    Ok(ResetFigures {
        boot_before,
        boot: hello.boot,
        cause: cause_name(hello.reset_cause),
        alarm: alarm.map_or(0, |record| record.number),
    })
}
