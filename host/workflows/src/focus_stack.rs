//! Depth from focus: a folder of images at different focus, to a depth map and an image that is sharp everywhere.

mod places;

use std::path::PathBuf;

use farnear_depth::{
    focus_stack::{self, StackMap, StackSettings},
    optics::{Distortion, DistortionSection},
    prepare::{
        align::{self, Model},
        straightened,
        warp::{Warp, resample},
    },
};
use farnear_files::{image_file, npy, staging::Staging, view};
use ndarray::{Array2, ArrayView2};
use serde::Serialize;

pub use places::{Places, depth_of_places, numbers};

use crate::{
    MADE_BY,
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
};

/// Which images, and what is made of them.
#[derive(Clone, PartialEq, Debug)]
pub struct FocusStackSettings {
    /// The folder: with `capture.toml`, as `rig sequence` writes it, or images in the order of their names.
    pub stack: PathBuf,
    /// Where each image is focused; without it `capture.toml` knows, or depth is the number of the image.
    pub places: Option<Places>,
    /// The lens; without it `capture.toml` knows.
    pub optics: Option<PathBuf>,
    /// How the stack is measured.
    pub computation: StackSettings,
    /// What may differ from image to image; `None` = they lie on each other.
    pub align: Option<Model>,
    /// The new folder.
    pub out: PathBuf,
}

/// What there is to say of a stack.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct FocusStackFigures {
    /// Images.
    pub images: usize,
    /// `mm`, or `image` where nobody knows where the images are focused.
    pub unit: &'static str,
    /// Part of the pixels with a value.
    pub known: f64,
    /// Median depth.
    pub median: Option<f64>,
    /// Farthest that a pixel was moved, px.
    pub moved_px: f64,
    /// What is doubtful.
    pub warnings: Vec<String>,
}

/// What stands in `stack.toml`.
#[derive(Serialize)]
struct Record<'a> {
    made_by: &'static str,
    unit: &'static str,
    measure: &'static str,
    smoothing_px: f32,
    median_px: usize,
    guided_px: f32,
    window_px: usize,
    fit_points: usize,
    min_reliability: f32,
    align: Option<Model>,
    /// The distortion that was taken out.
    distortion: Option<DistortionSection>,
    images: &'a [String],
    /// Object distances in mm at which the images are sharp.
    focused_at_mm: Option<&'a [f64]>,
}

/// Part of the pixels below which a stack is said to show too little.
const LITTLE: f64 = 0.5;

/// Measures a stack and writes `depth.npy`, `confidence.npy` (the reliability), `all-in-focus.png`, `view.png` and `stack.toml`.
///
/// # Errors
/// Images that cannot be read or are no stack; distances that are not as many as the images or go both ways; a folder that is
/// there already; [`WorkflowError::Cancelled`].
pub fn focus_stack(settings: &FocusStackSettings, context: &Context<'_>) -> Result<FocusStackFigures> {
    let staging = Staging::new_folder(&settings.out)?;
    let listed = places::of(settings)?;
    let mut images = read(&listed.images, context)?;
    let unseen = listed.distortion.map(|distortion| straighten(&mut images, &distortion));
    let moved_px = match settings.align {
        Some(model) => aligned(&mut images, model, context)?,
        None => 0.0,
    };
    context.cancel.check("measuring the stack")?;
    context.info(&format!("measuring {} images by {}", images.len(), settings.computation.measure));
    let views: Vec<ArrayView2<f32>> = images.iter().map(|image| image.view()).collect();
    let mut map = focus_stack::depth_from_stack(&views, &settings.computation)?;
    if let Some(unseen) = &unseen {
        for (at, _) in unseen.indexed_iter().filter(|(_, unseen)| **unseen) {
            (map.place[at], map.reliability[at]) = (f32::NAN, 0.0);
        }
    }
    context.cancel.check("writing the results")?;
    let depth = listed.depth(&map.place);
    let figures = figures(&depth, &listed, &map, moved_px);
    for warning in &figures.warnings {
        context.progress.warn(warning);
    }
    let names: Vec<String> = listed
        .images
        .iter()
        .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
        .collect();
    let StackSettings { measure, smoothing_px, window_px, fit_points, median_px, guided_px, min_reliability } =
        settings.computation;
    let record = Record {
        made_by: MADE_BY,
        unit: figures.unit,
        measure: measure.name(),
        smoothing_px,
        median_px,
        guided_px,
        window_px,
        fit_points,
        min_reliability,
        align: settings.align,
        distortion: listed.distortion.map(DistortionSection::from),
        images: &names,
        focused_at_mm: listed.focused_at_mm.as_deref(),
    };
    staging.write("depth.npy", &npy::write(depth.view()))?;
    staging.write("confidence.npy", &npy::write(map.reliability.view()))?;
    let codes = map.all_in_focus.mapv(|v| (v.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16);
    staging.write("all-in-focus.png", &image_file::encode_png(codes.view(), 16)?)?;
    staging.write("view.png", &view::view_png_in(figures.unit, depth.view(), map.reliability.view())?)?;
    staging.write("stack.toml", toml::to_string(&record)?.as_bytes())?;
    staging.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(figures)
}

fn read(images: &[PathBuf], context: &Context<'_>) -> Result<Vec<Array2<f32>>> {
    let mut all = Vec::with_capacity(images.len());
    for (index, path) in images.iter().enumerate() {
        context.cancel.check("reading the stack")?;
        all.push(image_file::read_grey(path)?.pixels);
        context.progress.advance("images", index + 1, Some(images.len()));
    }
    Ok(all)
}

/// Takes the lens' distortion out of all images; where it showed nothing of what would lie there, they keep their own pixels, and
/// the mask says so.
fn straighten(images: &mut [Array2<f32>], distortion: &Distortion) -> Array2<bool> {
    let mut unseen = Array2::from_elem((0, 0), false);
    for image in images {
        let straight = straightened(image.view(), distortion);
        unseen = straight.mapv(|value| !value.is_finite());
        let own = std::mem::replace(image, straight);
        image.zip_mut_with(&own, |straight, own| {
            if !straight.is_finite() {
                *straight = *own;
            }
        });
    }
    unseen
}

/// Aligns the images of a stack; returns the farthest distance that a pixel was moved, px.
///
/// # Errors
/// [`WorkflowError::Parameter`] if neighbours show nothing in common.
pub fn aligned_stack(images: &mut [Array2<f32>], model: Model) -> Result<f64> {
    aligned(images, model, &Context::unattended())
}

/// Lays each image on the one in the middle, by way of its neighbours, which differ least; gives the farthest way of a pixel.
/// What an image does not show is taken from its own border.
fn aligned(images: &mut [Array2<f32>], model: Model, context: &Context<'_>) -> Result<f64> {
    let middle = images.len() / 2;
    let size = images.first().map_or((0, 0), Array2::dim);
    let mut warps = vec![Warp::IDENTITY; images.len()];
    let outwards =
        (middle + 1..images.len()).map(|i| (i - 1, i)).chain((0..middle).rev().map(|i| (i + 1, i)));
    for (done, (nearer, index)) in outwards.enumerate() {
        context.cancel.check("aligning the stack")?;
        if images[index].dim() != size {
            // The measure names it.
            return Ok(0.0);
        }
        let step = align::estimate(images[nearer].view(), images[index].view(), model, Warp::IDENTITY);
        let step = step.ok_or_else(|| {
            let value = format!("between images {} and {}", nearer + 1, index + 1);
            WorkflowError::parameter("align", value, "the images show nothing in common to align by")
        })?;
        warps[index] = step.warp.after(&warps[nearer]);
        context.progress.advance("images aligned", done + 1, Some(images.len() - 1));
    }
    let mut farthest = 0.0_f64;
    for (image, warp) in images.iter_mut().zip(&warps) {
        if *warp == Warp::IDENTITY {
            continue;
        }
        let [right, bottom] = [size.1 as f64 - 1.0, size.0 as f64 - 1.0];
        for [x, y] in [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]] {
            let [to_x, to_y] = warp.at([x, y]);
            farthest = farthest.max((to_x - x).hypot(to_y - y));
        }
        let seen = resample(image.view(), warp);
        let own = std::mem::replace(image, seen);
        image.zip_mut_with(&own, |seen, own| {
            if !seen.is_finite() {
                *seen = *own;
            }
        });
    }
    Ok(farthest)
}

fn figures(depth: &Array2<f32>, listed: &places::Listed, map: &StackMap, moved_px: f64) -> FocusStackFigures {
    let mut values: Vec<f32> = depth.iter().copied().filter(|v| v.is_finite()).collect();
    let middle = values.len() / 2;
    let median = (!values.is_empty())
        .then(|| rounded(f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1), 3));
    let known = values.len() as f64 / depth.len().max(1) as f64;
    let ends = map.reliability.iter().filter(|r| **r == 0.0).count() as f64 / depth.len().max(1) as f64;
    let mut warnings = Vec::new();
    if known < LITTLE {
        warnings.push(format!(
            "only {:.0} % of the picture has a depth; {:.0} % is sharpest at an end of the stack or nowhere: a longer stack, more \
             texture or a larger --window may help",
            100.0 * known,
            100.0 * ends
        ));
    }
    FocusStackFigures {
        images: listed.images.len(),
        unit: if listed.focused_at_mm.is_some() { "mm" } else { "image" },
        known: rounded(known, 4),
        median,
        moved_px: rounded(moved_px, 2),
        warnings,
    }
}
