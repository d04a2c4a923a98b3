//! `farnear rig sequence`: runs an exposure program, from a file or as a focus stack, and writes its images.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_workflows::rig::sequence::{self, Program, SequenceSettings};

use super::{AxisName, CameraArguments, Target};
use crate::{
    report::{self, Usage},
    terminal,
};

/// Run an exposure program on the board: shots from a file, or a focus stack. Writes the images and capture.toml with the
/// position asked and measured, trigger and strobe times of each shot.
#[derive(Args)]
#[command(after_help = "\
PROGRAM.toml:
  exposure_us = 5000            # also: settle_window_nm, settle_dwell_us, repeat, trigger
  [[shot]]
  axis = \"fine\"                 # coarse, fine, lens
  to_um = 20.0
  [[shot]]
  axis = \"fine\"
  to_um = 170.0
  trigger = \"hardware\"          # hardware, software, free-running; the same for all shots

Example: farnear rig sequence --port sim --axis fine --from 20 --to 180 --steps 9 --out stack/")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The program.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["from", "to", "steps", "axis"])]
    program: Option<PathBuf>,
    /// The axis of a focus stack.
    #[arg(long, requires = "steps")]
    axis: Option<AxisName>,
    /// First position of the stack, um.
    #[arg(long, value_name = "UM", allow_negative_numbers = true, requires = "steps")]
    from: Option<f64>,
    /// Last position of the stack, um.
    #[arg(long, value_name = "UM", allow_negative_numbers = true, requires = "steps")]
    to: Option<f64>,
    /// Positions of the stack.
    #[arg(long, requires_all = ["axis", "from", "to"])]
    steps: Option<usize>,
    /// Run the armed program so often; the images of all runs are kept.
    #[arg(long, default_value_t = 1)]
    runs: usize,
    /// The optics file: for the record, and for what the emulated rig sees.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// The new folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let settings = SequenceSettings {
        program: program(&arguments)?,
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        runs: arguments.runs,
        optics: arguments.optics,
        out: arguments.out,
    };
    report::print(&sequence::run(&settings, &terminal::context()?)?, arguments.json)
}

fn program(arguments: &Arguments) -> Result<Program> {
    if let Some(path) = &arguments.program {
        return Ok(Program::File(path.clone()));
    }
    let (Some(axis), Some(from_um), Some(to_um), Some(steps)) =
        (arguments.axis, arguments.from, arguments.to, arguments.steps)
    else {
        bail!(Usage("a program is needed: --program FILE, or --axis, --from, --to and --steps".into()));
    };
    Ok(Program::Stack { axis: axis.axis(), from_um, to_um, steps })
}
