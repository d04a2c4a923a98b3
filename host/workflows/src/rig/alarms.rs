use farnear_capture::describe::alarm_text;
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{context::Context, error::Result};

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct AlarmFigures {
    /// Number of the latched alarm; 0 = none.
    pub latched: u32,
    pub alarms: Vec<AlarmEntry>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct AlarmEntry {
    pub number: u32,
    pub boot: u32,
    /// Time since that boot.
    pub time_s: f64,
    /// Description and remedy.
    pub text: String,
}

/// Lists the alarms after clearing alarm number `clear`.
pub fn alarms(rig: &RigAddress, clear: Option<u32>, context: &Context<'_>) -> Result<AlarmFigures> {
    let rig = Rig::connect(rig, None, context)?;
    if let Some(number) = clear {
        rig.client.clear_alarm(number)?;
        context.info(&format!(
            "alarm {number} is cleared; a stage that moved has lost its position: home it again"
        ));
    }
    let latched = rig.client.status()?.alarm.map_or(0, |record| record.number);
    let alarms = rig.client.alarms()?.into_iter().map(|record| AlarmEntry {
        number: record.number,
        boot: record.boot,
        time_s: record.time.0 as f64 / 1e6,
        text: alarm_text(record.alarm),
    });
    Ok(AlarmFigures { latched, alarms: alarms.collect() })
}
