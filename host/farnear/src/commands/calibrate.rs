//! `farnear calibrate`: learns what the optics do from captured images and depth maps.

mod camera;
mod correction;
mod psf;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Learn the point spread function, a correction of the lens's distortion, or the camera's own frames.
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
    Psf(psf::Arguments),
    Correction(correction::Arguments),
    Camera(camera::Arguments),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.what {
        What::Psf(arguments) => psf::run(arguments),
        What::Correction(arguments) => correction::run(arguments),
        What::Camera(arguments) => camera::run(arguments),
    }
}
