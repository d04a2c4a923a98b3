//! `farnear calibrate psf`: k of a Gaussian, or p and k of a generalised Gaussian, from a captured pair.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::calibrate::Model;
use farnear_workflows::calibrate::psf::{self, PsfSettings};

use crate::{report, terminal};

/// Find the point spread function from a pair of a flat, textured target at the far or near focus.
#[derive(Args)]
#[command(
    after_help = "Example: farnear calibrate psf far.png near.png --optics optics.toml --model gaussian --out calibrated.toml"
)]
pub struct Arguments {
    /// The image focused on the far plane.
    far: PathBuf,
    /// The image focused on the near plane.
    near: PathBuf,
    /// The optics file; its own point spread function does not matter.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// What to find: gaussian (k) or generalised (p and k).
    #[arg(long)]
    model: Model,
    /// Depth at which the target stands; without it the target is taken to stand at the focus of the sharper image.
    #[arg(long, value_name = "MM")]
    depth: Option<f64>,
    /// Where to write the optics with the point spread function that was found.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { far, near, optics, model, depth, out, json } = arguments;
    let settings = PsfSettings { far, near, optics, model, depth_mm: depth, out };
    report::print(&psf::fit(&settings, &terminal::context()?)?, json)
}
