//! `farnear rig calibrate`: the board measures its mechanics; a series of flat targets teaches the depth correction.

mod fit;
mod targets;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use farnear_protocol::message::{Axis, Routine};
use farnear_workflows::rig::mechanics;

use super::{AxisName, Target};
use crate::{
    report::{self, Usage},
    terminal,
};

/// Measure the rig's mechanics, or drive a series of flat targets that teaches the depth correction.
#[derive(Args)]
#[command(after_help = "Example: farnear rig calibrate backlash --port /dev/ttyACM0 --axis coarse")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Travel(TravelArguments),
    Backlash(BacklashArguments),
    Piezo(PiezoArguments),
    Gauge(GaugeArguments),
    Targets(targets::Arguments),
    Fit(fit::Arguments),
}

/// Measure the way between a stage's two end switches. The stage is homed by it.
#[derive(Args)]
#[command(after_help = "Example: farnear rig calibrate travel --port /dev/ttyACM0 --axis lens")]
struct TravelArguments {
    #[command(flatten)]
    target: Target,
    /// coarse or lens.
    #[arg(long)]
    axis: AxisName,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Measure a screw's backlash and keep it as a setting: moves take it out from then on.
#[derive(Args)]
#[command(after_help = "Example: farnear rig calibrate backlash --port /dev/ttyACM0 --axis coarse")]
struct BacklashArguments {
    #[command(flatten)]
    target: Target,
    /// coarse or lens.
    #[arg(long)]
    axis: AxisName,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Measure the piezo's gain, hysteresis and creep against its strain gauge, and keep them as settings.
#[derive(Args)]
#[command(after_help = "Example: farnear rig calibrate piezo --port /dev/ttyACM0 --json")]
struct PiezoArguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Measure the strain gauge's gain and zero against stage A's encoder, by way of its home switch, and keep them as settings. The
/// stage is homed by it.
#[derive(Args)]
#[command(after_help = "Example: farnear rig calibrate gauge --port /dev/ttyACM0 --json")]
struct GaugeArguments {
    #[command(flatten)]
    target: Target,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.what {
        What::Travel(arguments) => {
            let axis = stepper(arguments.axis)?;
            measure(&arguments.target, Routine::Travel { axis }, arguments.json)
        }
        What::Backlash(arguments) => {
            let axis = stepper(arguments.axis)?;
            measure(&arguments.target, Routine::Backlash { axis }, arguments.json)
        }
        What::Piezo(arguments) => measure(&arguments.target, Routine::Piezo, arguments.json),
        What::Gauge(arguments) => measure(&arguments.target, Routine::Gauge, arguments.json),
        What::Targets(arguments) => targets::run(arguments),
        What::Fit(arguments) => fit::run(arguments),
    }
}

fn stepper(name: AxisName) -> Result<Axis> {
    if name == AxisName::Fine {
        bail!(Usage("--axis fine has no screw: `farnear rig calibrate piezo` measures it".into()));
    }
    Ok(name.axis())
}

fn measure(target: &Target, routine: Routine, json: bool) -> Result<()> {
    report::print(&mechanics::measure(&target.address()?, routine, &terminal::context()?)?, json)
}
