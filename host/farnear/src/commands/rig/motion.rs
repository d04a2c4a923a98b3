//! `farnear rig home | move | stop | halt`.

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::{
    describe::um,
    ready::{ensure_homed, steppers},
};
use farnear_protocol::message::Axis;
use serde::Serialize;

use super::{AxisName, Target, nanometres};
use crate::report::{self, Usage};

/// Find the home switches and make them position 0: of all stages at once, or of those that are named.
#[derive(Args)]
#[command(after_help = "Example: farnear rig home --port /dev/ttyACM0 --axis lens")]
pub struct HomeArguments {
    #[command(flatten)]
    target: Target,
    /// The axis to home; may be given again. Without it all that have a home switch.
    #[arg(long, value_name = "AXIS")]
    axis: Vec<AxisName>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Move to absolute positions, several axes at once; outside the limits it is refused.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig move --port /dev/ttyACM0 --axis coarse --to-um 5800 --axis lens --to-um 1000"
)]
pub struct MoveArguments {
    #[command(flatten)]
    target: Target,
    /// The axis; may be given again, each with its --to-um.
    #[arg(long, value_name = "AXIS", required = true)]
    axis: Vec<AxisName>,
    /// The position in micrometres, positive = sensor and lens away from each other; 0 = home switch, or relaxed piezo.
    #[arg(long, value_name = "UM", allow_negative_numbers = true, required = true)]
    to_um: Vec<f64>,
    /// Home first what is not homed.
    #[arg(long)]
    home: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Stop all motion along the ramps and end a running program; positions stay known.
#[derive(Args)]
#[command(after_help = "Example: farnear rig stop --port /dev/ttyACM0")]
pub struct StopArguments {
    #[command(flatten)]
    target: Target,
}

/// Emergency stop: the last step comes within a millisecond; what moved has lost its position, and the alarm has to be
/// cleared (farnear rig alarms).
#[derive(Args)]
#[command(after_help = "Example: farnear rig halt --port /dev/ttyACM0")]
pub struct HaltArguments {
    #[command(flatten)]
    target: Target,
}

/// How far each encoder's old zero was from the new one.
#[derive(Serialize, Default)]
struct Homed {
    #[serde(skip_serializing_if = "Option::is_none")]
    shift_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lens_shift_um: Option<f64>,
}

#[derive(Serialize)]
struct Moved {
    axis: &'static str,
    asked_um: f64,
    measured_um: f64,
}

#[derive(Serialize)]
struct AllMoved {
    moved: Vec<Moved>,
}

/// Runs `home`.
pub fn home(arguments: HomeArguments) -> Result<()> {
    let rig = arguments.target.connect(None)?;
    let mut axes: Vec<Axis> = arguments.axis.iter().map(|name| name.axis()).collect();
    if axes.is_empty() {
        axes = steppers(&rig.client.hello().capabilities);
    }
    let started: Vec<_> =
        axes.iter().map(|axis| Ok((*axis, rig.client.start_home(*axis)?))).collect::<Result<_>>()?;
    let mut homed = Homed::default();
    for (axis, work) in started {
        let shift = Some(um(work.homed()?));
        match axis {
            Axis::Lens => homed.lens_shift_um = shift,
            Axis::SensorCoarse | Axis::SensorFine => homed.shift_um = shift,
        }
    }
    report::print(&homed, arguments.json)
}

/// Runs `move`.
pub fn go(arguments: MoveArguments) -> Result<()> {
    let MoveArguments { axis: axes, to_um, .. } = &arguments;
    if axes.len() != to_um.len() {
        let (axes, positions) = (axes.len(), to_um.len());
        bail!(Usage(format!("--axis is given {axes} times and --to-um {positions} times: they go together")));
    }
    if let Some(twice) =
        axes.iter().enumerate().find_map(|(at, axis)| axes[..at].contains(axis).then_some(axis))
    {
        bail!(Usage(format!("--axis {} is given twice", twice.axis().name())));
    }
    let targets: Vec<_> = axes
        .iter()
        .zip(to_um)
        .map(|(axis, to)| Ok((axis.axis(), nanometres(*to)?)))
        .collect::<Result<_>>()?;
    let rig = arguments.target.connect(None)?;
    if arguments.home {
        ensure_homed(&rig.client, &mut |what| eprintln!("{what}"))?;
    }
    let started: Vec<_> = targets
        .into_iter()
        .map(|(axis, target)| Ok((axis, rig.client.start_move(axis, target)?)))
        .collect::<Result<_>>()?;
    let mut moved = Vec::new();
    for (axis, work) in started {
        let end = work.moved()?;
        moved.push(Moved { axis: axis.name(), asked_um: um(end.asked), measured_um: um(end.measured) });
    }
    match &moved[..] {
        [one] => report::print(one, arguments.json),
        _ => report::print(&AllMoved { moved }, arguments.json),
    }
}

/// Runs `stop`.
pub fn stop(arguments: StopArguments) -> Result<()> {
    Ok(arguments.target.connect(None)?.client.stop()?)
}

/// Runs `halt`.
pub fn halt(arguments: HaltArguments) -> Result<()> {
    Ok(arguments.target.connect(None)?.client.halt()?)
}
