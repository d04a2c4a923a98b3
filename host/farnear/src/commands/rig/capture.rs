//! `farnear rig capture`: a far- and a near-focused image into a capture folder.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::{
    half_mirror::{self, HalfMirrorSettings},
    pair::{self, PairSettings},
};

use super::{CameraArguments, Target};
use crate::{report, terminal};

/// Capture a far- and a near-focused image: homes where needed, brings the stage near, exposes both by piezo.
///
/// The folder appears when everything is in it: far.png, near.png and capture.toml.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig capture --port /dev/ttyACM0 --camera folder:incoming/ --optics optics.toml --out pair1/\n\
                  \x20        farnear rig capture --port /dev/ttyACM0 --camera genicam: --set gain=2 --average 8 --optics optics.toml --out pair2/\n\
                  \x20        farnear rig capture --port /dev/ttyACM0 --camera genicam:A --half-mirror --second-camera genicam:B --optics optics.toml --out pair3/"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Average this many exposures per image (1 to 256): noise falls with the root of their number.
    #[arg(long, value_name = "N", default_value_t = 1)]
    average: u16,
    /// Take the camera's own dark and flat frames off both images: a folder of `farnear calibrate camera`. Do not give it to
    /// `farnear depth` again.
    #[arg(long, value_name = "DIR")]
    camera_frames: Option<PathBuf>,
    /// Take both images by one exposure: a half mirror stands behind the lens, and a second camera in its other path takes the near
    /// image (docs/rig.md). The stage goes to the far place. The emulated rig has one by itself.
    #[arg(long)]
    half_mirror: bool,
    /// The second camera, named as the first; exposure, wait and --set are those of both.
    #[arg(long, value_name = "CAMERA", requires = "half_mirror")]
    second_camera: Option<String>,
    /// How many micrometres further from the lens the second camera's sensor stands [default: what the optics ask for].
    #[arg(long, value_name = "UM", requires = "half_mirror")]
    second_further_um: Option<f64>,
    /// Mirror the second camera's image, for a camera in the reflected path that does not mirror it itself (ReverseX).
    #[arg(long, requires = "half_mirror")]
    second_mirrored: bool,
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
    let context = terminal::context()?;
    let figures = match arguments.half_mirror {
        false => pair::capture(&settings, &context)?,
        true => {
            let second = arguments.second_camera.map(|address| address.parse()).transpose()?;
            let (further_um, mirrored) = (arguments.second_further_um, arguments.second_mirrored);
            half_mirror::capture(
                &HalfMirrorSettings { pair: settings, second, further_um, mirrored },
                &context,
            )?
        }
    };
    report::print(&figures, arguments.json)
}
