//! Calibrates a lens file from one z-stack of a flat, textured target.

use std::path::{Path, PathBuf};

use farnear_depth::calibrate::stack::{StackLens, StackSettings, calibrate_stack};
use farnear_depth::optics::{RESPONSE_POINTS, Stage};
use farnear_files::{image_file::read_grey, staging};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    request::{PathKind, Request},
};

const ENDINGS: [&str; 5] = ["png", "tif", "tiff", "jpg", "jpeg"];
/// Share of errors within three standard deviations for the verdict `good`.
const HONEST: f64 = 0.97;
/// Least share of pixels with a depth.
const FILLED: f64 = 0.9;
/// Least span of the response in normalised depth, of 2.
const LEARNED: f64 = 1.2;

/// Calibrate a lens from a z-stack of a flat, textured target (tilted or not), slices one stage step apart.
///
/// Images are ordered by the last number in their names. Depth measured with the result is relative to the far plane unless
/// --far-mm is given.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "\
Example: farnear calibrate stack slices --step-mm 0.1 --out lens.toml
         farnear depth slices/06.png slices/11.png --optics lens.toml")
)]
#[serde(default)]
pub struct CalibrateStackRequest {
    /// Folder with the slices, one image each.
    pub folder: PathBuf,
    /// Distance between neighbouring slices in mm, or in any unit of the stage (um, steps); all depths are in that unit then.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub step_mm: f64,
    /// Pixel pitch of the camera, um; only the scale of point clouds depends on it.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM", default_value_t = Self::default().pixel_um))]
    pub pixel_um: f64,
    /// Distance of the far-focused plane of a pair, mm; without it depth is relative.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub far_mm: Option<f64>,
    /// Slices from the far to the near image of a pair; without it chosen for a largest blur of 2 to 3 px.
    #[cfg_attr(feature = "clap", arg(long, value_name = "SLICES"))]
    pub pair_step: Option<usize>,
    /// Pixels per side that are averaged into one; without it chosen with the pair step.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX"))]
    pub bin: Option<usize>,
    /// The first slice is focused nearest to the camera, not farthest.
    #[cfg_attr(feature = "clap", arg(long))]
    pub near_first: bool,
    /// File for the lens.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

impl Default for CalibrateStackRequest {
    fn default() -> Self {
        Self {
            folder: PathBuf::new(),
            step_mm: 0.0,
            pixel_um: 5.0,
            far_mm: None,
            pair_step: None,
            bin: None,
            near_first: false,
            out: PathBuf::new(),
        }
    }
}

impl Request for CalibrateStackRequest {
    const NAME: &'static str = "calibrate stack";
    const REQUIRED: &'static [&'static str] = &["folder", "step_mm", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("folder", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = StackFigures;

    fn run(&self, context: &Context<'_>) -> Result<StackFigures> {
        calibrate(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct StackFigures {
    /// `good`, or what to change.
    pub verdict: String,
    /// How to measure with the lens file.
    pub next: String,
    pub slices: usize,
    /// Slices from the far to the near image of a pair.
    pub pair_step: usize,
    /// Pixels per side averaged into one.
    pub bin: usize,
    pub psf: String,
    /// Largest blur radius, binned px.
    pub max_blur_px: f64,
    pub range_mm: f64,
    /// Blur radius per slice before and behind the focus, unbinned px.
    pub blur_per_slice_px: [f64; 2],
    /// Per slice: distance from the focus (slices), blur radius above the sharpest slice's (unbinned px).
    pub blur: Vec<[f64; 2]>,
    /// Least blur radius, binned px.
    pub blur_floor_px: f64,
    pub learned_mm: f64,
    /// `1.4826 x` median of |error| on held-out parts of the target.
    pub robust_mm: f64,
    /// On held-out parts, as the next five.
    pub rms_mm: f64,
    pub bias_mm: f64,
    /// Slope of measured over true depth.
    pub slope: f64,
    /// Share of pixels with a depth.
    pub fill: f64,
    /// Share of errors within three predicted standard deviations.
    pub within_three: f64,
    /// Root mean square of error / predicted standard deviation.
    pub scatter: f64,
    /// Standard deviation in excess of noise.
    pub residual_mm: f64,
    pub pairs: usize,
}

pub fn calibrate(request: &CalibrateStackRequest, context: &Context<'_>) -> Result<StackFigures> {
    let mut files = files(&request.folder)?;
    if request.near_first {
        files.reverse();
    }
    let slices =
        files.iter().map(|path| Ok(read_grey(path)?.pixels)).collect::<Result<Vec<Array2<f32>>>>()?;
    context.cancel.check("reading the slices")?;
    let settings = StackSettings {
        step_mm: request.step_mm,
        pixel_um: request.pixel_um,
        far_mm: request.far_mm,
        pair_step: request.pair_step,
        bin: request.bin,
    };
    let found = calibrate_stack(&slices, &settings)
        .map_err(|error| WorkflowError::parameter("folder", request.folder.display(), error.to_string()))?;
    context.cancel.check("calibrating the lens")?;
    staging::write_file(&request.out, toml::to_string(&found.optics)?.as_bytes())?;
    context.info(&format!("wrote {}", request.out.display()));
    Ok(figures(&found, &files, slices[0].dim(), request))
}

fn figures(
    found: &StackLens,
    files: &[PathBuf],
    size: (usize, usize),
    request: &CalibrateStackRequest,
) -> StackFigures {
    let StackLens { optics, blur, held_out, plane, .. } = found;
    let stage = optics.stage().copied().unwrap_or_else(|| Stage::identity(1, 1));
    let Stage { bin, pair_step, residual, .. } = stage;
    let range_mm = request.step_mm * pair_step as f64;
    let middle = plane.at(0.5 * size.0 as f64, 0.5 * size.1 as f64) - 0.5 * pair_step as f64;
    let far = (middle.round().max(0.0) as usize).min(files.len().saturating_sub(pair_step + 1));
    let next = format!(
        "take pairs {pair_step} slices ({range_mm} mm) apart, the far-focused image first: farnear depth {} {} --optics {}",
        files[far].display(),
        files[far + pair_step].display(),
        request.out.display()
    );
    StackFigures {
        verdict: verdict(found),
        next,
        slices: files.len(),
        pair_step,
        bin,
        psf: optics.psf().to_string(),
        max_blur_px: rounded(optics.max_blur_px(), 3),
        range_mm: rounded(range_mm, 6),
        blur_per_slice_px: blur.per_slice_px.map(|blur| rounded(blur, 3)),
        blur: blur.points.iter().map(|p| [p.slices, p.radius_px].map(|value| rounded(value, 3))).collect(),
        blur_floor_px: stage.blur_floor_px,
        learned_mm: rounded(0.5 * learned(found) * range_mm, 6),
        robust_mm: rounded(held_out.robust_mm, 6),
        rms_mm: rounded(held_out.rms_mm, 6),
        bias_mm: rounded(held_out.bias_mm, 6),
        slope: rounded(held_out.slope, 4),
        fill: rounded(held_out.fill, 4),
        within_three: rounded(held_out.within_three, 4),
        scatter: rounded(held_out.scatter, 3),
        residual_mm: rounded(0.5 * residual * range_mm, 6),
        pairs: held_out.pairs,
    }
}

/// `good`, or what to change.
pub fn verdict(found: &StackLens) -> String {
    let held_out = &found.held_out;
    let learned = learned(found);
    if learned < LEARNED {
        return format!(
            "only {:.0} % of the range of a pair was learned, depths outside that part are left out: take more slices around the focus, \
             or tilt the target",
            50.0 * learned
        );
    }
    if held_out.fill < FILLED {
        return format!(
            "only {:.0} % of the target has a depth: use a target with more fine texture, more light or a finer step",
            100.0 * held_out.fill
        );
    }
    if !(0.9..=1.1).contains(&held_out.slope) {
        return format!(
            "measured depth changes {:.2} times as much as the stage moves: take a finer step or more slices around the focus",
            held_out.slope
        );
    }
    if held_out.within_three < HONEST {
        return format!(
            "{:.0} % of the errors are within three predicted standard deviations, 97 % are expected: check that the target is flat \
             and the stage's steps are even",
            100.0 * held_out.within_three
        );
    }
    "good".into()
}

/// Normalised depth, of 2, that the response spans.
fn learned(found: &StackLens) -> f64 {
    found.optics.stage().map_or(2.0, |stage| stage.response[RESPONSE_POINTS - 1] - stage.response[0])
}

/// Images of a folder, by the last number in their names.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let unusable = |expected: String| WorkflowError::parameter("folder", folder.display(), expected);
    let entries = std::fs::read_dir(folder).map_err(|error| unusable(error.to_string()))?;
    let mut files: Vec<(f64, PathBuf)> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| {
            let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            ENDINGS.contains(&ending.as_str())
        })
        .filter_map(|path| last_number(&path).map(|number| (number, path)))
        .collect();
    files.sort_by(|a, b| a.0.total_cmp(&b.0));
    if files.is_empty() {
        return Err(unusable("expected images whose names hold their number, such as 01.png".into()));
    }
    Ok(files.into_iter().map(|(_, path)| path).collect())
}

fn last_number(path: &Path) -> Option<f64> {
    let stem = path.file_stem()?.to_string_lossy().into_owned();
    stem.split(|c: char| !c.is_ascii_digit()).rfind(|digits| !digits.is_empty())?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_ordered_by_the_last_number_in_their_names() {
        let number = |name: &str| last_number(Path::new(name));
        assert_eq!(number("a/slice_2_010.png"), Some(10.0));
        assert_eq!(number("9.tif"), Some(9.0));
        assert_eq!(number("target.png"), None);
    }
}
