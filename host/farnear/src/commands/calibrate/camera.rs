//! `farnear calibrate camera`: dark frame, pixel response and bad pixels of a camera.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::camera_frames::{self, CameraSettings};

use crate::{report, terminal};

/// Learn a camera's dark frame, the response of its pixels and its bad ones, for `farnear depth --camera`.
#[derive(Args)]
#[command(
    after_help = "Example: farnear calibrate camera --flat flat1.png flat2.png --dark dark1.png dark2.png --out camera/"
)]
pub struct Arguments {
    /// Exposures of even light at about half of full scale, out of focus: several, because their noise stays.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    flat: Vec<PathBuf>,
    /// Exposures with the lens covered; without any black is taken for 0.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    dark: Vec<PathBuf>,
    /// The folder for dark.npy, response.npy and bad.png.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { flat, dark, out, json } = arguments;
    report::print(
        &camera_frames::calibrate(&CameraSettings { dark, flat, out }, &terminal::context()?)?,
        json,
    )
}
