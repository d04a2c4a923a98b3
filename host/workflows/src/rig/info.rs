use farnear_capture::describe::{alarm_text, cause_name, program_name, state_name, um};
use farnear_protocol::message::AxisStatus;
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{context::Context, error::Result};

#[derive(Clone, PartialEq, Debug, Serialize)]
#[allow(missing_docs)] // the names say what they are, with their units
pub struct InfoFigures {
    pub board: String,
    pub firmware: String,
    pub protocol: u8,
    pub unique_id: String,
    pub emulated: bool,
    pub boot: u32,
    pub reset_cause: &'static str,
    pub datum_mm: f64,
    pub coarse_min_um: f64,
    pub coarse_max_um: f64,
    pub fine_min_um: f64,
    pub fine_max_um: f64,
    pub shots_max: u8,
    pub exposure_min_us: u32,
    pub exposure_max_us: u32,
    pub lens_min_um: f64,
    pub lens_max_um: f64,
    pub distance_min_mm: f64,
    pub has_lens_stage: bool,
    pub has_memory: bool,
    pub has_emergency_stop: bool,
    pub emergency_stop: bool,
    pub supply_low: bool,
    /// Number of the latched alarm; 0 = none.
    pub alarm: u32,
    pub alarm_text: String,
    pub program: &'static str,
    pub program_shots: u8,
    pub home_switch: bool,
    pub far_switch: bool,
    pub lens_home_switch: bool,
    pub lens_far_switch: bool,
    pub link_frames: u32,
    pub link_bad_frames: u32,
    pub coarse: AxisFigures,
    pub fine: AxisFigures,
    pub lens: AxisFigures,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct AxisFigures {
    /// Position state: unknown, homed, lost.
    pub state: &'static str,
    pub asked_um: f64,
    pub measured_um: f64,
    pub moving: bool,
}

impl From<&AxisStatus> for AxisFigures {
    fn from(status: &AxisStatus) -> Self {
        Self {
            state: state_name(status.state),
            asked_um: um(status.asked),
            measured_um: um(status.measured),
            moving: status.moving,
        }
    }
}

pub fn info(rig: &RigAddress, context: &Context<'_>) -> Result<InfoFigures> {
    let rig = Rig::connect(rig, None, context)?;
    let status = rig.client.status()?;
    let hello = rig.client.hello();
    let limits = hello.limits;
    Ok(InfoFigures {
        board: hello.board.as_str().into(),
        firmware: hello.firmware.as_str().into(),
        protocol: rig.client.protocol(),
        unique_id: hello.unique_id.iter().map(|byte| format!("{byte:02x}")).collect(),
        emulated: hello.emulated,
        boot: hello.boot,
        reset_cause: cause_name(hello.reset_cause),
        datum_mm: um(limits.datum) / 1e3,
        coarse_min_um: um(limits.coarse_min),
        coarse_max_um: um(limits.coarse_max),
        fine_min_um: um(limits.fine_min),
        fine_max_um: um(limits.fine_max),
        shots_max: limits.shots_max,
        exposure_min_us: limits.exposure_min.0,
        exposure_max_us: limits.exposure_max.0,
        lens_min_um: um(limits.lens_min),
        lens_max_um: um(limits.lens_max),
        distance_min_mm: um(limits.distance_min) / 1e3,
        has_lens_stage: hello.capabilities.lens,
        has_memory: hello.capabilities.memory,
        has_emergency_stop: hello.capabilities.emergency_stop,
        emergency_stop: status.emergency_stop,
        supply_low: status.supply_low,
        alarm: status.alarm.map_or(0, |record| record.number),
        alarm_text: status.alarm.map_or_else(String::new, |record| alarm_text(record.alarm)),
        program: program_name(status.program.state),
        program_shots: status.program.shots,
        home_switch: status.home_switch,
        far_switch: status.far_switch,
        lens_home_switch: status.lens_home_switch,
        lens_far_switch: status.lens_far_switch,
        link_frames: status.link.frames,
        link_bad_frames: status.link.bad_frames,
        coarse: (&status.coarse).into(),
        fine: (&status.fine).into(),
        lens: (&status.lens).into(),
    })
}
