//! `farnear rig capture`: a far- and a near-focused image into a capture folder.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::pair::{self, PairSettings};

use super::{CameraArguments, Target};
use crate::{report, terminal};

/// Capture a far- and a near-focused image: homes where needed, brings the stage near, exposes both by piezo.
///
/// The folder appears when everything is in it: far.png, near.png and capture.toml.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig capture --port /dev/ttyACM0 --camera folder:incoming/ --optics optics.toml --out pair1/\n\
                  \x20        farnear rig capture --port /dev/ttyACM0 --camera genicam: --set gain=2 --average 8 --optics optics.toml --out pair2/"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Take each image as the mean of so many exposures (1 to 256): noise falls with the root of their number.
    #[arg(long, value_name = "N", default_value_t = 1)]
    average: u16,
    /// Take the camera's own dark and flat frames off both images: a folder of `farnear calibrate camera`. Do not give it to
    /// `farnear depth` again.
    #[arg(long, value_name = "DIR")]
    camera_frames: Option<PathBuf>,
    /// The new capture folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let settings = PairSettings {
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        optics: arguments.optics,
        averaged: arguments.average,
        frames: arguments.camera_frames,
        out: arguments.out,
    };
    report::print(&pair::capture(&settings, &terminal::context()?)?, arguments.json)
}
