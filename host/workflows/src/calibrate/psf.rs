//! Fits a point spread function to pairs of a flat, textured target.

use std::path::PathBuf;

use farnear_depth::{
    calibrate::{CalibrationError, CapturedPair, Model, PsfFit, Verdict, fit_psf, made_ready},
    mosaic::{self, is_mosaic},
    optics::Optics,
    prepare::Align,
    psf::Psf,
};
use farnear_files::{image_file::read_grey, staging};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    figures::{rounded, rounded_for},
    optics,
    request::{PathKind, Request},
};

/// Decimals of p and k, beyond the precision of any pair.
const DECIMALS: [i32; 2] = [4, 5];

/// Find the point spread function from one pair or several of a flat, textured target.
///
/// Without --depth-mm the target is assumed at the focus of the sharper image.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear calibrate psf far.png near.png --optics optics.toml --model gaussian --out calibrated.toml
         farnear calibrate psf a/far.png a/near.png b/far.png b/near.png --depth-mm 900 --depth-mm 920 --optics optics.toml --model generalised"
    )
)]
#[serde(default)]
pub struct CalibratePsfRequest {
    /// The images of each pair: the far-focused one, the near-focused one; then those of the next pair.
    #[cfg_attr(feature = "clap", arg(num_args = 2.., required = true, value_names = ["FAR", "NEAR"]))]
    pub images: Vec<PathBuf>,
    /// The optics file; its point spread function is ignored.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Model: gaussian (finds k), generalised (p and k) or free (any round profile, as its OTF over frequency times blur radius).
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "DisplayFromStr")]
    pub model: Model,
    /// Registration of the near image to the far one: auto (a similarity if a significant one is found), none, optics, shift,
    /// similarity or affine.
    #[cfg_attr(feature = "clap", arg(long, value_name = "METHOD", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub align: Align,
    /// Depth of the target in mm, once for each pair; 0 = the focus of the sharper image [default: 0 for all].
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub depth_mm: Vec<f64>,
    /// File for the optics with the point spread function.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
}

impl Default for CalibratePsfRequest {
    fn default() -> Self {
        Self {
            images: Vec::new(),
            optics: PathBuf::new(),
            model: Model::Gaussian,
            align: Align::default(),
            depth_mm: Vec::new(),
            out: None,
        }
    }
}

impl Request for CalibratePsfRequest {
    const NAME: &'static str = "calibrate psf";
    const REQUIRED: &'static [&'static str] = &["images", "optics", "model"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("images", PathKind::Input), ("optics", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = PsfFigures;

    fn check(&self) -> Result<()> {
        let (images, depths) = (self.images.len(), self.depth_mm.len());
        if images == 0 || images % 2 != 0 {
            return Err(WorkflowError::parameter("images", images, "a far and a near image of each pair"));
        }
        if depths != 0 && depths != images / 2 {
            let expected = format!("{} pairs: give a depth for each, or for none", images / 2);
            return Err(WorkflowError::parameter("depth-mm", format!("given {depths} times"), expected));
        }
        Ok(())
    }

    fn run(&self, context: &Context<'_>) -> Result<PsfFigures> {
        fit(self, context)
    }
}

impl CalibratePsfRequest {
    /// Far and near image of each pair with the target's depth.
    fn pairs(&self) -> impl Iterator<Item = ([&PathBuf; 2], Option<f64>)> {
        let given = self.depth_mm.iter().map(|mm| Some(*mm).filter(|mm| *mm != 0.0));
        let depths = given.chain(std::iter::repeat(None));
        self.images.chunks_exact(2).map(|pair| [&pair[0], &pair[1]]).zip(depths)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PsfFigures {
    pub psf: String,
    /// Exponent of a generalised Gaussian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p: Option<f64>,
    /// Width / blur radius. Radial profile: of the Gaussian with the same second moment.
    pub k: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error_p: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error_k: Option<f64>,
    /// Share of the images' energy left when one is predicted from the other, 0 to 1.
    pub residual: f64,
    /// Expected residual from noise alone.
    pub noise_residual: f64,
    /// `good`, `loose` (uncertain by more than 1 %) or `unexplained` (residual above noise).
    pub verdict: String,
    /// Assumed distance of the target; the first of several.
    pub target_mm: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub targets_mm: Vec<f64>,
    /// Displacement of each near image, if any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub moved_px: Vec<f64>,
    /// OTF of a radial profile: frequency x blur radius (rad), value, standard error.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub otf: Vec<[f64; 3]>,
}

pub fn fit(settings: &CalibratePsfRequest, context: &Context<'_>) -> Result<PsfFigures> {
    let optics = optics::read(&settings.optics)?;
    if optics.stage().is_some() {
        let expected = CalibrationError::LearnedLens.to_string();
        return Err(WorkflowError::parameter("optics", settings.optics.display(), expected));
    }
    let (mut images, mut moved_px) = (Vec::new(), Vec::new());
    for ([far, near], depth_mm) in settings.pairs() {
        let alpha = depth_mm.map(|depth_mm| alpha_at(depth_mm, &optics)).transpose()?;
        let read = [read_grey(far)?.pixels, read_grey(near)?.pixels];
        if is_mosaic(read[0].view()) {
            context.progress.warn(mosaic::WORDS);
        }
        let (ready, report) = made_ready(read, &optics, settings.align)
            .about(|| format!("{} and {}", far.display(), near.display()))?;
        images.push((ready, alpha));
        moved_px.push(report.aligned.map_or(0.0, |aligned| rounded(aligned.displacement_px, 3)));
        context.cancel.check("reading the pairs")?;
    }
    let pairs: Vec<CapturedPair<'_>> = images
        .iter()
        .map(|([far, near], alpha)| CapturedPair { far: far.view(), near: near.view(), alpha: *alpha })
        .collect();
    let found = fit_psf(&pairs, &optics, settings.model)?;
    let doubt = doubt(&found, settings.model);
    if let Some(doubt) = &doubt {
        context.progress.warn(doubt);
    }
    context.cancel.check("fitting the point spread function")?;
    let psf = rounded_psf(found.psf);
    if let Some(out) = &settings.out {
        let comment = doubt.map_or_else(String::new, |doubt| format!("# {}: {doubt}\n", found.verdict()));
        staging::write_file(out, (comment + &toml::to_string(&optics.with_psf(psf))?).as_bytes())?;
        context.info(&format!("wrote {}: {}", out.display(), found.verdict()));
    }
    let (p, k) = match psf {
        Psf::Gaussian { k } => (None, k),
        Psf::Generalised { p, k } => (Some(p), k),
        Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_) => (None, rounded(found.width(), DECIMALS[1])),
    };
    let range = optics.working_range();
    let target_mm = |alpha: &f64| rounded_for(range.far_mm - range.near_mm, optics.depth_mm(*alpha), 3);
    let targets_mm: Vec<f64> = found.alphas.iter().map(target_mm).collect();
    Ok(PsfFigures {
        psf: psf.to_string(),
        p,
        k,
        standard_error_p: found.standard_error_p.map(|error| rounded(error, DECIMALS[0] + 1)),
        standard_error_k: found.standard_error_k.map(|error| rounded(error, DECIMALS[1] + 1)),
        residual: rounded(found.residual, 6),
        noise_residual: rounded(found.noise, 6),
        verdict: found.verdict().to_string(),
        target_mm: targets_mm.first().copied().unwrap_or(f64::NAN),
        targets_mm: if targets_mm.len() > 1 { targets_mm } else { Vec::new() },
        moved_px: if moved_px.iter().any(|moved| *moved > 0.0) { moved_px } else { Vec::new() },
        otf: found
            .otf
            .iter()
            .map(|point| [point.z, rounded(point.value, 5), rounded(point.standard_error, 6)])
            .collect(),
    })
}

/// Doubt about a fit.
pub fn doubt(found: &PsfFit, model: Model) -> Option<String> {
    let width = found.width();
    match found.verdict() {
        Verdict::Good => None,
        Verdict::Loose => {
            let error = found
                .standard_error_k
                .map_or("unknown".into(), |error| format!("{:.1} % of it", 100.0 * error / width));
            Some(format!(
                "the width k = {width:.4} is loose: its standard error is {error}, 1 % is wanted; give more pairs, a target with more \
                 fine detail, or one that stands at a focus"
            ))
        }
        Verdict::Unexplained => Some(format!(
            "the {model} point spread function leaves {:.2} % of the images' energy, noise {:.2} %: {}do both images show the same, \
             are they linear in light (no tone curve), does the target stand where it is said to, are far_mm and max_blur_px right? \
             Depth measured with it is biased",
            100.0 * found.residual,
            100.0 * found.noise,
            if model == Model::Free { "" } else { "try the model free; else: " }
        )),
    }
}

fn alpha_at(depth_mm: f64, optics: &Optics) -> Result<f64> {
    let focal_length_mm = optics.focal_length_mm();
    if !(depth_mm.is_finite() && depth_mm > focal_length_mm) {
        let expected = format!(
            "a target there has no image behind a lens of {focal_length_mm} mm: give its distance from the lens in mm"
        );
        return Err(WorkflowError::parameter("depth-mm", depth_mm, expected));
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

#[cfg(test)]
mod tests {
    use farnear_depth::optics::Stage;

    use super::*;

    #[test]
    fn a_learned_lens_is_refused_before_the_images_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let optics: Optics = toml::from_str(include_str!("../../../../examples/rig.toml")).unwrap();
        let file = folder.path().join("lens.toml");
        let text = toml::to_string(&optics.with_stage(Stage::identity(2, 1))).unwrap();
        std::fs::write(&file, text).unwrap();
        let images = ["far.png", "near.png"].map(|name| folder.path().join(name)).to_vec();
        let request = CalibratePsfRequest { images, optics: file, ..CalibratePsfRequest::default() };
        let error = fit(&request, &Context::unattended()).unwrap_err();
        let text = error.to_string();
        assert!(error.is_usage() && text.contains("lens.toml") && text.contains("already found"), "{text}");
    }
}
