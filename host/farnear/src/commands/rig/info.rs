//! `farnear rig info`: who is there and how it is.

use anyhow::Result;
use clap::Args;
use farnear_capture::describe::{alarm_text, cause_name, program_name, state_name, um};
use farnear_protocol::message::AxisStatus;
use serde::Serialize;

use super::Target;
use crate::report;

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

#[derive(Serialize)]
struct Figures {
    board: String,
    firmware: String,
    protocol: u8,
    unique_id: String,
    emulated: bool,
    boot: u32,
    reset_cause: &'static str,
    datum_mm: f64,
    coarse_min_um: f64,
    coarse_max_um: f64,
    fine_min_um: f64,
    fine_max_um: f64,
    shots_max: u8,
    lens_min_um: f64,
    lens_max_um: f64,
    distance_min_mm: f64,
    has_lens_stage: bool,
    has_memory: bool,
    has_emergency_stop: bool,
    emergency_stop: bool,
    supply_low: bool,
    alarm: u32,
    alarm_text: String,
    program: &'static str,
    program_shots: u8,
    home_switch: bool,
    far_switch: bool,
    lens_home_switch: bool,
    lens_far_switch: bool,
    link_frames: u32,
    link_bad_frames: u32,
    coarse: Axis,
    fine: Axis,
    lens: Axis,
}

#[derive(Serialize)]
struct Axis {
    state: &'static str,
    asked_um: f64,
    measured_um: f64,
    moving: bool,
}

impl From<AxisStatus> for Axis {
    fn from(status: AxisStatus) -> Self {
        Self {
            state: state_name(status.state),
            asked_um: um(status.asked),
            measured_um: um(status.measured),
            moving: status.moving,
        }
    }
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let rig = arguments.target.connect(None)?;
    let status = rig.client.status()?;
    let hello = rig.client.hello();
    let limits = hello.limits;
    let figures = Figures {
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
        coarse: status.coarse.into(),
        fine: status.fine.into(),
        lens: status.lens.into(),
    };
    report::print(&figures, arguments.json)
}
