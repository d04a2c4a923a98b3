//! `farnear calibrate`: learns what the optics do from captured images and depth maps.

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::{
    calibrate::{
        correction::CalibrateCorrectionRequest, psf::CalibratePsfRequest, stack::CalibrateStackRequest,
    },
    camera_frames::CalibrateCameraRequest,
};

use crate::run::Run;

/// Learn the point spread function, a correction of the lens's distortion, the camera's own frames, or a whole lens from a z-stack.
#[derive(Args)]
#[command(
    after_help = "Example: farnear calibrate psf far.png near.png --optics optics.toml --model gaussian"
)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Psf(Run<CalibratePsfRequest>),
    Correction(Run<CalibrateCorrectionRequest>),
    Stack(Run<CalibrateStackRequest>),
    Camera(Run<CalibrateCameraRequest>),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.what {
        What::Psf(task) => task.run(),
        What::Correction(task) => task.run(),
        What::Stack(task) => task.run(),
        What::Camera(task) => task.run(),
    }
}
