//! `farnear calibrate psf`: k of a Gaussian, or p and k of a generalised Gaussian, from a captured pair.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_capture::{aside, image_file::read_grey};
use farnear_depth::{
    calibrate::{CapturedPair, Model, fit_psf},
    psf::Psf,
};
use serde::Serialize;

use crate::{files, report};

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

#[derive(Serialize)]
struct Figures {
    psf: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    p: Option<f64>,
    k: f64,
    /// What is left of the images' energy when one is made from the other, 0 to 1.
    residual: f64,
    target_mm: f64,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::read(&arguments.optics)?;
    let far = read_grey(&arguments.far)?.pixels;
    let near = read_grey(&arguments.near)?.pixels;
    if let Some(depth_mm) = arguments.depth
        && !(depth_mm.is_finite() && depth_mm > optics.focal_length_mm())
    {
        anyhow::bail!(
            "a target at {depth_mm} mm has no image behind a lens of {} mm: give its distance from the lens in mm",
            optics.focal_length_mm()
        );
    }
    let alpha = arguments.depth.map(|depth_mm| optics.alpha(depth_mm));
    let pair = CapturedPair { far: far.view(), near: near.view(), alpha };
    let found = fit_psf(&[pair], &optics, arguments.model)?;
    let (p, k) = match found.psf {
        Psf::PillBox => (None, 1.0),
        Psf::Gaussian { k } => (None, k),
        Psf::Generalised { p, k } => (Some(p), k),
    };
    let rounded = match found.psf {
        Psf::PillBox => Psf::PillBox,
        Psf::Gaussian { k } => Psf::Gaussian { k: report::rounded(k, 5) },
        Psf::Generalised { p, k } => Psf::Generalised { p: report::rounded(p, 4), k: report::rounded(k, 5) },
    };
    if let Some(out) = &arguments.out {
        let text = toml::to_string(&optics.with_psf(rounded))?;
        aside::write_file(out, text.as_bytes())?;
        eprintln!("wrote {}", out.display());
    }
    let figures = Figures {
        psf: rounded.to_string(),
        p: p.map(|p| report::rounded(p, 4)),
        k: report::rounded(k, 5),
        residual: report::rounded(found.residual, 6),
        target_mm: report::rounded(found.alphas.first().map_or(f64::NAN, |alpha| optics.depth_mm(*alpha)), 3),
    };
    report::print(&figures, arguments.json)
}
