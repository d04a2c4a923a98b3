//! The point spread function from pairs of a flat, textured target: k of a Gaussian, or p and k of a generalised one.

use std::path::PathBuf;

use farnear_depth::{
    calibrate::{CapturedPair, Model, fit_psf},
    optics::Optics,
    psf::Psf,
};
use farnear_files::{image_file::read_grey, staging};
use serde::Serialize;

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    optics,
};

/// Decimals of p and of k: no pair tells them better.
const DECIMALS: [i32; 2] = [4, 5];

/// A pair of a flat target.
#[derive(Clone, PartialEq, Debug)]
pub struct TargetPair {
    /// The far-focused image.
    pub far: PathBuf,
    /// The near-focused image.
    pub near: PathBuf,
    /// Where the target stands; without it it is taken to stand at the focus of the sharper image.
    pub depth_mm: Option<f64>,
}

/// What is looked at, and for what.
#[derive(Clone, PartialEq, Debug)]
pub struct PsfSettings {
    /// One pair or several, which are fitted together.
    pub pairs: Vec<TargetPair>,
    /// The optics file; its own point spread function does not matter.
    pub optics: PathBuf,
    /// What to find.
    pub model: Model,
    /// Where the optics with what was found are written to.
    pub out: Option<PathBuf>,
}

/// What was found.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PsfFigures {
    /// The point spread function by name.
    pub psf: String,
    /// Exponent of a generalised Gaussian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p: Option<f64>,
    /// Width over blur radius.
    pub k: f64,
    /// What is left of the images' energy when one is made from the other, 0 to 1.
    pub residual: f64,
    /// Where the target was taken to stand; the first of several.
    pub target_mm: f64,
    /// Where each of several was.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub targets_mm: Vec<f64>,
}

/// Finds the point spread function.
///
/// # Errors
/// Optics, images, [`WorkflowError::Calibration`]; [`WorkflowError::Parameter`] for a target inside the focal length.
pub fn fit(settings: &PsfSettings, context: &Context<'_>) -> Result<PsfFigures> {
    let optics = optics::read(&settings.optics)?;
    let mut images = Vec::new();
    for pair in &settings.pairs {
        let alpha = pair.depth_mm.map(|depth_mm| alpha_at(depth_mm, &optics)).transpose()?;
        images.push((read_grey(&pair.far)?.pixels, read_grey(&pair.near)?.pixels, alpha));
        context.cancel.check("reading the pairs")?;
    }
    let pairs: Vec<CapturedPair<'_>> = images
        .iter()
        .map(|(far, near, alpha)| CapturedPair { far: far.view(), near: near.view(), alpha: *alpha })
        .collect();
    let found = fit_psf(&pairs, &optics, settings.model)?;
    context.cancel.check("fitting the point spread function")?;
    let psf = rounded_psf(found.psf);
    if let Some(out) = &settings.out {
        staging::write_file(out, toml::to_string(&optics.with_psf(psf))?.as_bytes())?;
        context.say(&format!("wrote {}", out.display()));
    }
    let (p, k) = match psf {
        Psf::Gaussian { k } => (None, k),
        Psf::Generalised { p, k } => (Some(p), k),
        // No model of a calibration.
        Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_) => (None, 1.0),
    };
    let targets_mm: Vec<f64> = found.alphas.iter().map(|alpha| rounded(optics.depth_mm(*alpha), 3)).collect();
    Ok(PsfFigures {
        psf: psf.to_string(),
        p,
        k,
        residual: rounded(found.residual, 6),
        target_mm: targets_mm.first().copied().unwrap_or(f64::NAN),
        targets_mm: if targets_mm.len() > 1 { targets_mm } else { Vec::new() },
    })
}

fn alpha_at(depth_mm: f64, optics: &Optics) -> Result<f64> {
    let focal_length_mm = optics.focal_length_mm();
    if !(depth_mm.is_finite() && depth_mm > focal_length_mm) {
        let expected = format!(
            "a target there has no image behind a lens of {focal_length_mm} mm: give its distance from the lens in mm"
        );
        return Err(WorkflowError::parameter("depth", depth_mm, expected));
    }
    Ok(optics.alpha(depth_mm))
}

fn rounded_psf(psf: Psf) -> Psf {
    let [of_p, of_k] = DECIMALS;
    match psf {
        Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_) => psf,
        Psf::Gaussian { k } => Psf::Gaussian { k: rounded(k, of_k) },
        Psf::Generalised { p, k } => Psf::Generalised { p: rounded(p, of_p), k: rounded(k, of_k) },
    }
}
