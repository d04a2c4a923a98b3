//! `farnear rig calibrate`: the board measures its mechanics; a series of flat targets teaches the depth correction.

mod fit;
mod targets;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use farnear_capture::{describe::um, ready::ensure_homed};
use farnear_protocol::message::{Axis, Calibration, Routine};
use serde::Serialize;

use super::{AxisName, Target};
use crate::report::{self, Usage};

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

#[derive(Serialize)]
#[serde(untagged)]
enum Figures {
    Travel { axis: &'static str, travel_um: f64 },
    Backlash { axis: &'static str, backlash_um: f64, spread_um: f64 },
    Piezo { gain_pm_per_code: u32, hysteresis_percent: f64, creep_percent_per_decade: f64 },
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
    let rig = target.connect(None)?;
    if matches!(routine, Routine::Backlash { .. }) {
        ensure_homed(&rig.client, &mut |what| eprintln!("{what}"))?;
    }
    let figures = match rig.client.calibrate(routine)? {
        Calibration::Travel { axis, length } => Figures::Travel { axis: axis.name(), travel_um: um(length) },
        Calibration::Backlash { axis, backlash, spread } => {
            Figures::Backlash { axis: axis.name(), backlash_um: um(backlash), spread_um: um(spread) }
        }
        Calibration::Piezo { gain_pm_per_code, hysteresis_ppm, creep_ppm_per_decade } => Figures::Piezo {
            gain_pm_per_code,
            hysteresis_percent: f64::from(hysteresis_ppm) / 1e4,
            creep_percent_per_decade: f64::from(creep_ppm_per_decade) / 1e4,
        },
    };
    report::print(&figures, json)
}
