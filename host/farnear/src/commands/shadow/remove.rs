//! `farnear shadow remove`: takes a person's shadow off masks by where the sun stands and how the camera does.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_activity::shadow::Method;
use farnear_workflows::shadow::removal::{self, RemovalSettings};

use crate::{commands::sun::MomentArguments, report, terminal};

/// Takes a person's shadow off masks: the sun's place and the camera's tell where the shadow falls.
///
/// The camera file says how the camera stands:
///
///     [camera]
///     height_m = 0.8              # lens above the ground
///     azimuth_deg = 140.0         # viewing direction, anticlockwise from north
///     pitch_deg = 0.0             # downwards positive
///     focal_length_mm = 4.0
///     pixel_um = 6.0
///     width_px = 640
///     height_px = 480
///
/// and, in tables `subject` (height_m = 1.75, head_width_m = 0.17) and `standard_deviations`, what differs from the usual. Frames whose cut is doubtful (nobody or several people in it, the shadow behind the person or cut off by the picture's
/// lower edge, much removed, an angle too unsure) are flagged in `shadow.toml` beside the masks.
#[derive(Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Example: farnear shadow remove masks/ --camera camera.toml --time 2014-06-23T11:30:00Z --lat 52.38 \
                  --lon -1.56 --out clean/"
)]
pub struct Arguments {
    /// Masks of a person with their shadow: a folder of pictures or one picture, full frames.
    masks: PathBuf,
    /// How the camera stands, TOML.
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    #[command(flatten)]
    moment: MomentArguments,
    /// Masks per second: with it `--time` is the first mask's and the sun moves on.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// hybrid, or thesis (as printed in Li 2014).
    #[arg(long, default_value = "hybrid")]
    method: Method,
    /// Folder for the masks without shadow; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// See [`removal::remove_from_masks`].
pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    let settings = RemovalSettings {
        masks: arguments.masks,
        camera: arguments.camera,
        moment: arguments.moment.moment(),
        rate_hz: arguments.rate_hz,
        method: arguments.method,
        out: arguments.out,
    };
    report::print(&removal::remove_from_masks(&settings, &terminal::counting(json)?)?, json)
}
