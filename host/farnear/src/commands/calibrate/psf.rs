//! `farnear calibrate psf`: k of a Gaussian, p and k of a generalised Gaussian, or any round profile, from captured pairs.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_depth::{calibrate::Model, prepare::Align};
use farnear_workflows::calibrate::psf::{self, PsfSettings, TargetPair};

use crate::{
    report::{self, Usage},
    terminal,
};

/// Find the point spread function from one pair or several of a flat, textured target; without --depth at the far or near focus.
#[derive(Args)]
#[command(
    after_help = "Example: farnear calibrate psf far.png near.png --optics optics.toml --model gaussian --out calibrated.toml\n\
                  \x20        farnear calibrate psf a/far.png a/near.png b/far.png b/near.png --depth 900 --depth 920 --optics optics.toml \
                  --model generalised"
)]
pub struct Arguments {
    /// The images of each pair: the one focused on the far plane, the one focused on the near plane; then the next pair's.
    #[arg(num_args = 2.., required = true, value_names = ["FAR", "NEAR"])]
    images: Vec<PathBuf>,
    /// The optics file; its own point spread function does not matter.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// What to find: gaussian (k), generalised (p and k) or free (any round profile, with its OTF over frequency times blur
    /// radius).
    #[arg(long)]
    model: Model,
    /// How the near image is laid on the far one: auto (a similarity, where one is found beyond doubt), none, optics, shift,
    /// similarity or affine.
    #[arg(long, value_name = "HOW", default_value_t)]
    align: Align,
    /// Depth at which the target stands, once for each pair; without it it is taken to stand at the focus of the sharper image.
    #[arg(long, value_name = "MM")]
    depth: Vec<f64>,
    /// Where to write the optics with the point spread function that was found.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { images, optics, model, align, depth, out, json } = arguments;
    if images.len() % 2 != 0 {
        bail!(Usage(format!("{} images: expected a far and a near one of each pair", images.len())));
    }
    let count = images.len() / 2;
    if !depth.is_empty() && depth.len() != count {
        let given = depth.len();
        bail!(Usage(format!(
            "--depth is given {given} times for {count} pairs: give it for each, or not at all"
        )));
    }
    let pairs = images
        .chunks_exact(2)
        .enumerate()
        .map(|(at, pair)| TargetPair {
            far: pair[0].clone(),
            near: pair[1].clone(),
            depth_mm: depth.get(at).copied(),
        })
        .collect();
    let settings = PsfSettings { pairs, optics, model, align, out };
    report::print(&psf::fit(&settings, &terminal::context()?)?, json)
}
