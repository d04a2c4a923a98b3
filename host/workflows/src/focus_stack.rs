//! Depth from focus: a depth map and an all-in-focus image from images at different focus.

mod black_border;
mod frames;
mod images;
mod in_memory;
mod positions;

use std::{
    fmt,
    path::{Path, PathBuf},
    str::FromStr,
};

use farnear_depth::{
    focus_stack::{self, Sharpness, Slices, StackMap, StackSettings},
    optics::{DistortionSection, Optics},
    prepare::align::Model,
};
use farnear_files::{
    image_file::{self, Grey},
    npy, view,
};
use images::Images;
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

pub use images::fill_specks;
pub use in_memory::{PreparedStack, prepare_stack};
pub use positions::{depth_of_places, even_positions};

use crate::{
    MADE_BY,
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    inputs::{HashedFile, hashed},
    optics::another_size,
    quantile,
    request::{PathKind, Request},
    result_folder::{self, STACK_RECORD},
};

/// Compute depth from a stack of images at different focus, and the image that is sharp everywhere.
///
/// Writes depth.npy, confidence.npy (the reliability), all-in-focus.png, view.png and stack.toml.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear focus-stack stack/ --out stack/depth\n\
                          \x20        farnear focus-stack cells.ome.tif --out depth/\n\
                          \x20        farnear focus-stack photos/ --align similarity --distances-mm 300,310,320,330,340 --out depth/")
)]
#[serde(default)]
pub struct FocusStackRequest {
    /// The folder of `farnear rig sequence`, a folder with images in the order of their numbers, or a TIFF with several pages.
    pub stack: PathBuf,
    /// Distances from lens to object at which the images are focused, in mm. Without any, the folder's capture.toml or the TIFF's
    /// metadata give positions, else depth is the number of the image.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM,...", value_delimiter = ',', value_parser = number))]
    pub distances_mm: Option<Vec<f64>>,
    /// Distances from lens to sensor, in mm.
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_name = "MM,...",
            value_delimiter = ',',
            value_parser = number,
            conflicts_with = "distances_mm"
        )
    )]
    pub sensor_mm: Option<Vec<f64>>,
    /// Positions of the stage, in um, also zero or negative (--positions-um=-5,0,5); depth.npy is in um then.
    #[cfg_attr(
        feature = "clap",
        arg(
            long,
            value_name = "UM,...",
            value_delimiter = ',',
            value_parser = number,
            allow_hyphen_values = true,
            conflicts_with_all = ["distances_mm", "sensor_mm"]
        )
    )]
    pub positions_um: Option<Vec<f64>>,
    /// Optics file [default: the folder's capture.toml or optics.toml].
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: Option<PathBuf>,
    /// How colour becomes grey: mean, luma, red, green or blue.
    #[cfg_attr(feature = "clap", arg(long, value_name = "CHANNEL", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub grey: Grey,
    /// Code at which the camera saturates, such as 4095 for 12 bits in 16 [default: from the files].
    #[cfg_attr(feature = "clap", arg(long, value_name = "CODE"))]
    pub white_level: Option<u32>,
    /// Focus measure (a wrong name lists all).
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME", default_value_t = Self::default().measure))]
    #[serde_as(as = "DisplayFromStr")]
    pub measure: Sharpness,
    /// Blur the images by a Gaussian of this standard deviation before measuring sharpness, in pixels, 0 to 10: finer detail is
    /// mostly noise.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().smoothing_px))]
    pub smoothing_px: f32,
    /// Side of the median over the depths found, in pixels: odd, 1 (none) to 31.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().median_px))]
    pub median_px: usize,
    /// Mend the depths along the edges of the sharp image, so that objects do not grow over a dull background: standard
    /// deviation of the window in pixels, 1 to 100; 0 = off.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().guided_px))]
    pub guided_px: f32,
    /// Side of the window over which sharpness is measured, in pixels: odd, 3 to 101.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().window_px))]
    pub window_px: usize,
    /// Images that the tip of a pixel's sharpness is fitted to, at most: odd, 3 to 31.
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", default_value_t = Self::default().fit_points))]
    pub fit_points: usize,
    /// Registration of the images: none, shift, similarity (breathing lenses, hand-held cameras) or affine.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MODEL", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub align: StackAlign,
    /// Use all images, also those that show another scene, are turned or shaken.
    #[cfg_attr(feature = "clap", arg(long))]
    pub use_all: bool,
    /// Remove depths with a lower reliability, 0 to 1; 0 keeps all.
    #[cfg_attr(feature = "clap", arg(long, value_name = "R", default_value_t = Self::default().min_reliability))]
    pub min_reliability: f32,
    /// Folder for the results: a new one, or that of an earlier focus stack, which is replaced.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

/// A number of a list, which may have blanks around it.
#[cfg(feature = "clap")]
fn number(text: &str) -> std::result::Result<f64, std::num::ParseFloatError> {
    text.trim().parse()
}

impl Default for FocusStackRequest {
    fn default() -> Self {
        let StackSettings {
            measure,
            smoothing_px,
            window_px,
            fit_points,
            median_px,
            guided_px,
            min_reliability,
        } = StackSettings::default();
        Self {
            stack: PathBuf::new(),
            distances_mm: None,
            sensor_mm: None,
            positions_um: None,
            optics: None,
            grey: Grey::default(),
            white_level: None,
            measure,
            smoothing_px,
            median_px,
            guided_px,
            window_px,
            fit_points,
            align: StackAlign::default(),
            use_all: false,
            min_reliability,
            out: PathBuf::new(),
        }
    }
}

impl Request for FocusStackRequest {
    const NAME: &'static str = "focus-stack";
    const REQUIRED: &'static [&'static str] = &["stack", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("stack", PathKind::Input), ("optics", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = FocusStackFigures;

    fn check(&self) -> Result<()> {
        for (name, numbers) in [("distances-mm", &self.distances_mm), ("sensor-mm", &self.sensor_mm)] {
            if let Some(wrong) = numbers.iter().flatten().find(|v| !(v.is_finite() && **v > 0.0)) {
                return Err(WorkflowError::parameter(
                    name,
                    wrong,
                    "distances from the lens are above 0; for positions of a stage give --positions-um",
                ));
            }
        }
        if let Some(wrong) = self.positions_um.iter().flatten().find(|v| !v.is_finite()) {
            return Err(WorkflowError::parameter("positions-um", wrong, "a number"));
        }
        let given = [&self.distances_mm, &self.sensor_mm, &self.positions_um];
        if given.iter().filter(|numbers| numbers.is_some()).count() > 1 {
            let expected = "one of distances-mm, sensor-mm and positions-um";
            return Err(WorkflowError::parameter("distances-mm", "(several kinds of positions)", expected));
        }
        Ok(self.computation().check()?)
    }

    fn run(&self, context: &Context<'_>) -> Result<FocusStackFigures> {
        focus_stack(self, context)
    }
}

impl FocusStackRequest {
    fn computation(&self) -> StackSettings {
        StackSettings {
            measure: self.measure,
            smoothing_px: self.smoothing_px,
            window_px: self.window_px,
            fit_points: self.fit_points,
            median_px: self.median_px,
            guided_px: self.guided_px,
            min_reliability: self.min_reliability,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct StackAlign(pub Option<Model>);

impl fmt::Display for StackAlign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.0 {
            None => "none",
            Some(Model::Shift) => "shift",
            Some(Model::Similarity) => "similarity",
            Some(Model::Affine) => "affine",
        })
    }
}

impl FromStr for StackAlign {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, &'static str> {
        match text {
            "none" => Ok(Self(None)),
            "shift" => Ok(Self(Some(Model::Shift))),
            "similarity" => Ok(Self(Some(Model::Similarity))),
            "affine" => Ok(Self(Some(Model::Affine))),
            _ => Err("expected none, shift, similarity or affine"),
        }
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct FocusStackFigures {
    pub images: usize,
    pub left_out: Vec<String>,
    /// Unit of depth: `mm`, `um` (stage positions), or `image` if the positions are unknown.
    pub unit: &'static str,
    /// Share of pixels with a value.
    pub known: f64,
    pub median: Option<f64>,
    /// Largest displacement of a pixel by alignment; `None` without.
    pub moved_px: Option<f64>,
    pub warnings: Vec<String>,
}

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
    grey: Grey,
    white_level: Option<u32>,
    images: &'a [String],
    /// Brightness of each image relative to the usual one; images are divided by it.
    #[serde(skip_serializing_if = "is_even")]
    brightness: &'a [f64],
    /// Largest change over the stack, as a logarithm, of the vignetting that images are divided by.
    #[serde(skip_serializing_if = "Option::is_none")]
    vignetting: Option<f64>,
    left_out: &'a [String],
    positions: &'a [f64],
    distortion: Option<DistortionSection>,
    /// Side of a pixel at the object, from the stack's metadata.
    object_pixel_um: Option<f64>,
    optics: Option<Optics>,
    input: Vec<HashedFile>,
}

fn is_even(gains: &[f64]) -> bool {
    gains.iter().all(|gain| *gain == 1.0)
}

/// Brightness of a picture relative to its full scale below which it would be black in 8 bits.
const BLACK: f32 = 1.0 / 256.0;
/// Least share of pixels with a value, below which a warning is given.
const LITTLE: f64 = 0.5;

pub fn focus_stack(request: &FocusStackRequest, context: &Context<'_>) -> Result<FocusStackFigures> {
    request.check()?;
    let staging = result_folder::stack(&request.out, &request.stack)?;
    let mut listed = positions::of(request)?;
    let inputs: Vec<PathBuf> = listed.images.iter().cloned().chain(listed.described_by.clone()).collect();
    let mut warnings = std::mem::take(&mut listed.remarks);
    let mut images = Images::read(&listed.images, request, &mut warnings, &staging, context)?;
    let mut frames =
        frames::of_stack(&images, &listed.even_positions(), request.align.0, request.use_all, context)?;
    warnings.extend(frames.remarks(|index| name(&listed.images[index])));
    let left_out: Vec<String> =
        frames.left_out.iter().map(|(index, _)| name(&listed.images[*index])).collect();
    let indices: Vec<usize> = frames.left_out.iter().map(|(index, _)| *index).collect();
    for index in indices.iter().rev() {
        images.remove(*index);
        frames.warps.remove(*index);
        frames.gains.remove(*index);
    }
    warnings.extend(images.bordered());
    let doubt = listed.optics.as_ref().and_then(|lens| another_size(lens, images.dim(0)));
    warnings.extend(doubt.map(|doubt| doubt.to_string()));
    if !is_even(&frames.gains) {
        let [least, most] = [f64::min, f64::max].map(|of| frames.gains.iter().copied().fold(1.0, of));
        context.info(&format!(
            "evening out the brightness of the images, {least:.2} to {most:.2} of the usual one"
        ));
    }
    images.divide_by(&frames.gains);
    listed.without(&indices);
    let moved_px = request.align.0.map(|_| frames::farthest_px(&frames.warps, images.dim(0)));
    let unseen = images.prepare(listed.distortion(), &frames.warps)?;
    // Of aligned images, because a lens that breathes in uneven light looks alike.
    let vignetting = images.even_vignetting(&listed.even_positions())?;
    if let Some(change) = vignetting {
        context.info(&format!(
            "evening out vignetting that changes by up to {:.0} % over the stack",
            100.0 * change
        ));
    }
    context.info(&format!("measuring {} images by {}", images.count(), request.measure));
    let mut map =
        focus_stack::depth_from_positions(&images, &listed.even_positions(), &request.computation())?;
    let white = white_of(&map.all_in_focus, images.code_step() == 0.0);
    drop(images);
    withhold(&mut map, unseen.as_ref());
    context.cancel.check("writing the results")?;
    let depth = listed.depth(&map.place);
    let figures = figures(&depth, &listed, &map, moved_px, left_out, warnings);
    for warning in &figures.warnings {
        context.progress.warn(warning);
    }
    let names: Vec<String> = listed.images.iter().map(|path| name(path)).collect();
    let record = Record {
        made_by: MADE_BY,
        unit: figures.unit,
        measure: request.measure.name(),
        smoothing_px: request.smoothing_px,
        median_px: request.median_px,
        guided_px: request.guided_px,
        window_px: request.window_px,
        fit_points: request.fit_points,
        min_reliability: request.min_reliability,
        align: request.align.0,
        grey: request.grey,
        white_level: request.white_level,
        images: &names,
        brightness: &frames.gains,
        vignetting: vignetting.map(|change| rounded(change, 4)),
        left_out: &figures.left_out,
        positions: &listed.positions,
        distortion: listed.distortion().map(DistortionSection::from),
        object_pixel_um: listed.object_pixel_um,
        optics: listed.optics,
        input: hashed(&inputs, &request.out)?,
    };
    staging.write("depth.npy", &npy::write(depth.view()))?;
    staging.write("confidence.npy", &npy::write(map.reliability.view()))?;
    let codes = map.all_in_focus.mapv(|v| ((v / white).clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16);
    staging.write("all-in-focus.png", &image_file::encode_png(codes.view(), 16)?)?;
    staging.write("view.png", &view::view_png_in(figures.unit, depth.view(), map.reliability.view())?)?;
    staging.write(STACK_RECORD, toml::to_string(&record)?.as_bytes())?;
    staging.finish()?;
    context.info(&format!("wrote {}", request.out.display()));
    Ok(figures)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Removes the places of pixels that an image has no value for.
fn withhold(map: &mut StackMap, unseen: Option<&Array2<bool>>) {
    let Some(unseen) = unseen else { return };
    for (at, _) in unseen.indexed_iter().filter(|(_, unseen)| **unseen) {
        (map.place[at], map.reliability[at]) = (f32::NAN, 0.0);
    }
}

/// Value that becomes white: 1, or the brightest value if floats exceed 1 or the picture would be black in 8 bits.
fn white_of(picture: &Array2<f32>, are_floats: bool) -> f32 {
    let brightest = picture.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    let is_usual = brightest <= 0.0 || brightest >= BLACK && (brightest <= 1.0 || !are_floats);
    if is_usual { 1.0 } else { brightest }
}

/// A remark on a map with few depths.
pub fn scarce(depth: &Array2<f32>, map: &StackMap) -> Option<String> {
    let share = |count: usize| count as f64 / depth.len().max(1) as f64;
    let known = share(depth.iter().filter(|depth| depth.is_finite()).count());
    let ends = share(map.reliability.iter().filter(|reliability| **reliability == 0.0).count());
    (known < LITTLE).then(|| {
        format!(
            "only {:.0} % of the picture has a depth; {:.0} % is sharpest at an end of the stack or nowhere: a longer stack, more \
             texture or a larger window (window-px) may help",
            100.0 * known,
            100.0 * ends
        )
    })
}

fn figures(
    depth: &Array2<f32>,
    listed: &positions::Listed,
    map: &StackMap,
    moved_px: Option<f64>,
    left_out: Vec<String>,
    mut warnings: Vec<String>,
) -> FocusStackFigures {
    let values: Vec<f32> = depth.iter().copied().filter(|v| v.is_finite()).collect();
    let [least, most] = [f32::min, f32::max].map(|of| values.iter().copied().reduce(of).unwrap_or_default());
    let median = quantile::of_map(depth.view(), 0.5);
    let median = median.map(|median| rounded_for(f64::from(most - least), median, 3));
    let known = values.len() as f64 / depth.len().max(1) as f64;
    warnings.extend(scarce(depth, map));
    FocusStackFigures {
        images: listed.images.len(),
        left_out,
        unit: listed.axis.unit(),
        known: rounded(known, 4),
        median,
        moved_px: moved_px.map(|px| rounded(px, 2)),
        warnings,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_checked_before_the_images_are_read() {
        let usual = FocusStackRequest::default;
        assert!(usual().check().is_ok());
        for (request, phrase) in [
            (FocusStackRequest { window_px: 8, ..usual() }, "the window is 8"),
            (FocusStackRequest { median_px: 2, ..usual() }, "median's window is 2"),
            (FocusStackRequest { fit_points: 1, ..usual() }, "number of points is 1"),
            (FocusStackRequest { guided_px: 0.5, ..usual() }, "0.5 px"),
            (FocusStackRequest { smoothing_px: f32::NAN, ..usual() }, "NaN px"),
            (FocusStackRequest { min_reliability: 5.0, ..usual() }, "reliability below 5"),
            (FocusStackRequest { min_reliability: f32::NAN, ..usual() }, "reliability below NaN"),
        ] {
            let error = request.check().unwrap_err().to_string();
            assert!(error.contains(phrase), "{error}");
        }
    }

    #[test]
    fn a_picture_of_any_scale_is_neither_white_nor_black() {
        for (brightest, are_floats, white) in [
            (4095.0, true, 4095.0),
            (0.9, true, 1.0),
            (1e-6, false, 1e-6),
            (1.02, false, 1.0),
            (0.05, false, 1.0),
            (0.0, true, 1.0),
        ] {
            let picture = ndarray::array![[0.0, brightest, f32::NAN]];
            assert_eq!(white_of(&picture, are_floats), white, "{brightest}");
        }
    }
}
