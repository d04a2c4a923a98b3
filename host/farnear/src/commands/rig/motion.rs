//! `farnear rig home | move | stop`.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use farnear_capture::describe::um;
use farnear_protocol::{Nanometres, message::Axis};
use serde::Serialize;

use super::Target;
use crate::report;

/// Find the home switch of the coarse stage and make it position 0.
#[derive(Args)]
#[command(after_help = "Example: farnear rig home --port /dev/ttyACM0")]
pub struct HomeArguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Move to an absolute position; outside the limits it is refused.
#[derive(Args)]
#[command(after_help = "Example: farnear rig move --port /dev/ttyACM0 --axis coarse --to-um 5800")]
pub struct MoveArguments {
    #[command(flatten)]
    target: Target,
    /// The axis.
    #[arg(long)]
    axis: AxisName,
    /// The position in micrometres, positive away from the lens; coarse 0 = home switch, fine 0 = relaxed piezo.
    #[arg(long, value_name = "UM", allow_negative_numbers = true)]
    to_um: f64,
    /// Home first where that is needed.
    #[arg(long)]
    home: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Stop all motion and end a running program.
#[derive(Args)]
#[command(after_help = "Example: farnear rig stop --port /dev/ttyACM0")]
pub struct StopArguments {
    #[command(flatten)]
    target: Target,
}

#[derive(Clone, Copy, ValueEnum)]
enum AxisName {
    /// Stage A's stepper and screw.
    Coarse,
    /// Stage A's piezo.
    Fine,
}

#[derive(Serialize)]
struct Homed {
    shift_um: f64,
}

#[derive(Serialize)]
struct Moved {
    asked_um: f64,
    measured_um: f64,
}

/// Runs `home`.
pub fn home(arguments: HomeArguments) -> Result<()> {
    let mut rig = arguments.target.connect(None)?;
    let shift = rig.client.home(Axis::SensorCoarse)?;
    report::print(&Homed { shift_um: um(shift) }, arguments.json)
}

/// Runs `move`.
pub fn go(arguments: MoveArguments) -> Result<()> {
    let target = nanometres(arguments.to_um)?;
    let axis = match arguments.axis {
        AxisName::Coarse => Axis::SensorCoarse,
        AxisName::Fine => Axis::SensorFine,
    };
    let mut rig = arguments.target.connect(None)?;
    if arguments.home {
        rig.client.home(Axis::SensorCoarse)?;
    }
    let moved = rig.client.move_to(axis, target)?;
    report::print(&Moved { asked_um: um(moved.asked), measured_um: um(moved.measured) }, arguments.json)
}

/// Runs `stop`.
pub fn stop(arguments: StopArguments) -> Result<()> {
    let mut rig = arguments.target.connect(None)?;
    Ok(rig.client.stop()?)
}

fn nanometres(position_um: f64) -> Result<Nanometres> {
    let nm = (position_um * 1e3).round();
    if !nm.is_finite() || nm.abs() > f64::from(i32::MAX) {
        bail!("{position_um} um is no position: expected a number between -2147483 and 2147483 um");
    }
    Ok(Nanometres(nm as i32))
}
