//! Calibrates a lens file from one z-stack of a flat, textured target.

mod pair;
mod plot;
mod verdict;

use std::{
    path::{MAIN_SEPARATOR, Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use farnear_capture::record::read_record;
use farnear_depth::{
    calibrate::stack::{AtDepth, LENSES, Moved, StackError, StackLens, StackSettings, calibrate_stack},
    optics::{Optics, Stage},
};
use farnear_files::{
    image_file::{Grey, ReadSettings, Samples, SharedWhiteLevel, relative},
    order, stack, staging,
};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    focus_stack::fill_specks,
    optics,
    plot::Format,
    request::{PathKind, Request},
};
use pair::pair_to_try;
pub use pair::{curved_light, filled_pixels, raw_mosaic};
pub use verdict::verdict;

/// Largest difference of a step from the usual one, relative to it.
const EVEN: f64 = 0.1;
/// Largest difference of the given step from the stated one, relative to it.
const SAME_STEP: f64 = 0.02;

/// Calibrate a lens from a z-stack of a flat, textured target (tilted or not), slices one stage step apart.
///
/// Depth measured with the result is relative to the far plane unless --far-mm is given. The stack of a rig (farnear rig sequence)
/// gives distances by its optics.
#[serde_as]
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
    /// A folder with the slices in the order of their numbers, a TIFF with several pages, or the folder of `farnear rig sequence`.
    pub stack: PathBuf,
    /// Distance between neighbouring slices in mm (0.5 um is 0.0005). Steps in degrees, dioptres or volts give depths in that
    /// unit, also where a name has mm. By default the step of the TIFF's metadata, of positions in the names (z-83um.png) or of
    /// the rig's record.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub step_mm: Option<f64>,
    /// Side of a pixel at the target, in um [default: that of the TIFF's metadata, if the files state the step, too]. Without it slopes
    /// and meshes are per pixel.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM"))]
    pub object_pixel_um: Option<f64>,
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
    /// How colour becomes grey: mean, luma, red, green or blue.
    #[cfg_attr(feature = "clap", arg(long, value_name = "CHANNEL", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub grey: Grey,
    /// Code at which the camera saturates, such as 4095 for 12 bits in 16 [default: from the files].
    #[cfg_attr(feature = "clap", arg(long, value_name = "CODE"))]
    pub white_level: Option<u32>,
    /// Folder with the camera's dark and flat frames, from `farnear calibrate camera`.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub camera_frames: Option<PathBuf>,
    /// File for a plot of blur, response and errors: .svg or .png.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub plot: Option<PathBuf>,
    /// File for the lens.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

impl Default for CalibrateStackRequest {
    fn default() -> Self {
        Self {
            stack: PathBuf::new(),
            step_mm: None,
            object_pixel_um: None,
            far_mm: None,
            pair_step: None,
            bin: None,
            near_first: false,
            grey: Grey::default(),
            white_level: None,
            camera_frames: None,
            plot: None,
            out: PathBuf::new(),
        }
    }
}

impl Request for CalibrateStackRequest {
    const NAME: &'static str = "calibrate stack";
    const REQUIRED: &'static [&'static str] = &["stack", "out"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("stack", PathKind::Input),
        ("camera_frames", PathKind::Input),
        ("out", PathKind::OutputFile),
        ("plot", PathKind::OutputFile),
    ];
    type Figures = StackFigures;

    fn check(&self) -> Result<()> {
        let given =
            [("step-mm", self.step_mm), ("object-pixel-um", self.object_pixel_um), ("far-mm", self.far_mm)];
        for (name, value) in given {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                let reversed = "; if the first slice is focused nearest, give --near-first";
                let remedy = if name == "step-mm" && value < 0.0 { reversed } else { "" };
                let expected = format!("expected a positive number{remedy}");
                return Err(WorkflowError::parameter(name, value, expected));
            }
        }
        Ok(())
    }

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
    /// Measured and true normalised depth, -1 (far plane) to 1.
    pub response: Vec<[f64; 2]>,
    /// Errors on held-out parts at each depth.
    pub by_depth: Vec<AtDepth>,
}

pub fn calibrate(request: &CalibrateStackRequest, context: &Context<'_>) -> Result<StackFigures> {
    request.check()?;
    let plot = match &request.plot {
        Some(file) => Some((file, Format::of(file)?)),
        None => None,
    };
    let listed = Listed::of(request)?;
    listed.remarks.iter().for_each(|remark| context.progress.warn(remark));
    let (slices, coding) = read(&listed.images, request, context)?;
    let moved = match listed.lens {
        Some(lens) => Moved::Sensor(Box::new(lens)),
        None => Moved::Target {
            object_pixel_um: request.object_pixel_um.or(listed.object_pixel_um),
            far_mm: request.far_mm,
        },
    };
    let (step_mm, pair_step, bin) = (listed.step_mm, request.pair_step, request.bin);
    let settings = StackSettings { step_mm, moved, pair_step, bin, coding };
    let step_mm = rounded_for(listed.step_mm, listed.step_mm, 6);
    context.info(&format!("calibrating the lens from {} slices {step_mm} mm apart", slices.len()));
    let told = AtomicUsize::new(0);
    let proceed = |tried: usize| {
        if told.fetch_max(tried, Ordering::Relaxed) < tried {
            context.progress.advance("lenses", tried, Some(LENSES));
        }
        !context.cancel.is_cancelled()
    };
    let found = calibrate_stack(&slices, &settings, &proceed);
    context.cancel.check("calibrating the lens")?;
    let found = found.map_err(|error| match error {
        StackError::OutOfRange { name, value, expected } => {
            WorkflowError::parameter(name, value, format!("expected {expected}"))
        }
        error => WorkflowError::parameter("stack", request.stack.display(), error.to_string()),
    })?;
    let figures = figures(&found, &listed, slices[0].dim(), request);
    if let Some(doubt) = curved_light(&found, &slices) {
        context.progress.warn(&doubt);
    }
    let drawn = match plot {
        Some((file, format)) => Some((file, plot::plot(&figures, format)?)),
        None => None,
    };
    staging::write_file(&request.out, toml::to_string(&found.optics)?.as_bytes())?;
    context.info(&format!("wrote {}", request.out.display()));
    if let Some((file, bytes)) = drawn {
        staging::write_file(file, &bytes)?;
        context.info(&format!("wrote {}", file.display()));
    }
    Ok(figures)
}

/// Slices, the far-focused first.
struct Listed {
    images: Vec<PathBuf>,
    step_mm: f64,
    /// Of the rig whose sensor moved.
    lens: Option<Optics>,
    object_pixel_um: Option<f64>,
    remarks: Vec<String>,
}

impl Listed {
    fn of(request: &CalibrateStackRequest) -> Result<Self> {
        let record = if request.stack.is_dir() { read_record(&request.stack)? } else { None };
        Ok(match record {
            Some(record) => {
                let given = request.step_mm.or(request.far_mm).or(request.object_pixel_um);
                if given.is_some() || request.near_first {
                    let expected = "the rig's record has them: leave --step-mm, --far-mm, --object-pixel-um and --near-first out";
                    return Err(WorkflowError::parameter("stack", request.stack.display(), expected));
                }
                let (lens, _) = optics::of_pair(None, &request.stack.join("slice.png"))?;
                if lens.distortion().is_some() {
                    let expected = "optics without [distortion]: a lens from a stack cannot have one yet";
                    return Err(WorkflowError::parameter("stack", request.stack.display(), expected));
                }
                let mut order: Vec<(f64, PathBuf)> = record
                    .exposure
                    .iter()
                    .map(|exposure| (exposure.sensor_measured_mm, request.stack.join(&exposure.image)))
                    .collect();
                order.sort_by(|a, b| a.0.total_cmp(&b.0));
                let (positions, images): (Vec<f64>, Vec<PathBuf>) = order.into_iter().unzip();
                let step_mm = even_step(&positions, request, "")?;
                Self { images, step_mm, lens: Some(lens), object_pixel_um: None, remarks: Vec::new() }
            }
            None => {
                let stack::Stack { mut images, positions_um, mut object_pixel_um, mut remarks } =
                    stack::list(&request.stack)?;
                if let (None, Some([before, after])) = (&positions_um, order::gap(&images)) {
                    let expected = format!(
                        "evenly spaced slices, but at least one is missing between {} and {}: take the stack again, or move the slices \
                         on one side of the gap away",
                        before.display(),
                        after.display()
                    );
                    return Err(WorkflowError::parameter("stack", request.stack.display(), expected));
                }
                let are_named = positions_um.is_none();
                let positions_um = positions_um.or_else(|| stack::positions_in_names(&images));
                let rounded = "; if the positions are rounded, give --step-mm";
                let remedy = if request.step_mm.is_none() { rounded } else { "" };
                let stated = positions_um.map(|positions| even_step(&positions, request, remedy));
                let step_mm = match (request.step_mm, stated) {
                    (Some(step_mm), stated) => {
                        // The metadata's pixel is in um, --step-mm may be in degrees or volts.
                        if !stated.as_ref().is_some_and(|stated| agrees(step_mm, stated)) {
                            object_pixel_um = None;
                        }
                        remarks.extend(contradiction(step_mm, stated));
                        step_mm
                    }
                    (None, Some(stated)) => {
                        let step_mm = stated? * 1e-3;
                        let read = rounded_for(step_mm, step_mm, 6);
                        let remark =
                            || format!("the names of the slices state a step of {read} mm, which is used");
                        remarks.extend(are_named.then(remark));
                        step_mm
                    }
                    (None, None) => {
                        let expected = "the distance between neighbouring slices: neither metadata nor names such as z-83um.png \
                                        state it";
                        return Err(WorkflowError::parameter("step-mm", "(none)", expected));
                    }
                };
                if request.near_first {
                    images.reverse();
                }
                Self { images, step_mm, lens: None, object_pixel_um, remarks }
            }
        })
    }
}

fn agrees(step_mm: f64, stated_um: &Result<f64>) -> bool {
    stated_um.as_ref().is_ok_and(|step_um| (step_um * 1e-3 - step_mm).abs() <= SAME_STEP * step_mm)
}

/// What the files state otherwise than `--step-mm`.
fn contradiction(step_mm: f64, stated: Option<Result<f64>>) -> Option<String> {
    let stated = match stated.filter(|stated| !agrees(step_mm, stated))? {
        Ok(step_um) => format!("a step of {} mm", rounded_for(step_um * 1e-3, step_um * 1e-3, 4)),
        Err(error) => format!("uneven positions ({error})"),
    };
    Some(format!("the files state {stated}, and --step-mm {step_mm} is used: check the unit"))
}

/// Mean step between positions that are in order, above 0.
fn even_step(positions: &[f64], request: &CalibrateStackRequest, remedy: &str) -> Result<f64> {
    let steps: Vec<f64> = positions.windows(2).map(|two| two[1] - two[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let even = |step: f64| (step - usual).abs() <= EVEN * usual.abs();
    match steps.iter().enumerate().find(|(_, step)| !even(**step)) {
        Some((index, step)) => {
            let (from, to) = (index + 1, index + 2);
            let [step, usual] = [*step, usual].map(|step| rounded_for(usual, step, 4));
            let expected = format!(
                "expected even steps, but slices {from} and {to} are {step} apart, {usual} is usual{remedy}"
            );
            Err(WorkflowError::parameter("stack", request.stack.display(), expected))
        }
        None => Ok(rounded((steps.iter().sum::<f64>() / steps.len().max(1) as f64).abs(), 9)),
    }
}

/// The slices, and the mean variance of a pixel by lossy compression.
fn read(
    images: &[PathBuf],
    request: &CalibrateStackRequest,
    context: &Context<'_>,
) -> Result<(Vec<Array2<f32>>, f64)> {
    let settings = ReadSettings { grey: request.grey, white_level: request.white_level };
    let frames = request.camera_frames.as_deref().map(|folder| context.cache.camera(folder)).transpose()?;
    let mut slices = Vec::with_capacity(images.len());
    let mut white = SharedWhiteLevel::default();
    let (mut coding, mut filled, mut are_floats) = (0.0, 0, None);
    stack::read(images, &settings, |index, mut image| -> Result<()> {
        context.cancel.check("reading the slices")?;
        context.progress.advance("slices", index + 1, Some(images.len()));
        white.add(&image);
        let is_float = image.samples == Samples::Float;
        if *are_floats.get_or_insert(is_float) != is_float {
            let expected = "expected pixels of one kind in all slices, integers or floats: scales differ";
            return Err(WorkflowError::parameter("stack", images[index].display(), expected));
        }
        if let Some(frames) = &frames {
            let clipped = match image.samples {
                Samples::Integer(_) => image.white_level.unwrap_or(1.0),
                Samples::Float => f32::INFINITY,
            };
            image.pixels = frames.correct_below(image.pixels.view(), clipped)?;
        }
        filled += fill_specks(&mut image.pixels, image.samples == Samples::Float).len();
        let holes = image.pixels.iter().filter(|value| !value.is_finite()).count();
        if holes > 0 {
            let expected = format!(
                "expected a value in each pixel, but {holes} have none (NaN, transparent, or 1000 times the usual one): crop or fill them"
            );
            return Err(WorkflowError::parameter("stack", images[index].display(), expected));
        }
        coding += image.coding_variance / images.len() as f64;
        if index == 0
            && let Some(remark) = raw_mosaic(&image.pixels)
        {
            context.progress.warn(&remark);
        }
        slices.push(image.pixels);
        Ok(())
    })?;
    if let Some(remark) = filled_pixels(filled) {
        context.progress.warn(&remark);
    }
    if let Some(white) = white.get(request.white_level.is_some()) {
        slices.iter_mut().for_each(|slice| slice.mapv_inplace(|value| relative(value, white)));
        coding /= f64::from(white).powi(2);
    }
    Ok((slices, coding))
}

/// A path as a word of a shell's command.
fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || c == MAIN_SEPARATOR || "._-+:,@%".contains(c);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

fn figures(
    found: &StackLens,
    listed: &Listed,
    size: (usize, usize),
    request: &CalibrateStackRequest,
) -> StackFigures {
    let StackLens { optics, blur, held_out, .. } = found;
    let files = &listed.images;
    let stage = optics.stage().copied().unwrap_or_else(|| Stage::identity(1, 1));
    let Stage { bin, pair_step, residual, .. } = stage;
    let range = optics.working_range();
    let range_mm = range.far_mm - range.near_mm;
    let [far, near] = pair_to_try(found, size, files.len());
    let out = shell_word(&request.out);
    let of_range = |mm: f64| rounded_for(range_mm, mm, 4);
    let of_error = |mm: f64| rounded_for(held_out.rms_mm, mm, 3);
    let next = match listed.lens {
        Some(_) => format!("farnear rig capture --optics {out} --out pair/"),
        None => format!(
            "take pairs {pair_step} slices ({} mm) apart, the far-focused image first (at any other distance depth is wrong \
             without a warning): farnear depth {} {} --optics {out}",
            of_range(range_mm),
            shell_word(&files[far]),
            shell_word(&files[near])
        ),
    };
    StackFigures {
        verdict: verdict(found),
        next,
        slices: files.len(),
        pair_step,
        bin,
        psf: optics.psf().to_string(),
        max_blur_px: rounded(optics.max_blur_px(), 3),
        range_mm: of_range(range_mm),
        blur_per_slice_px: blur.per_slice_px.map(|blur| rounded(blur, 3)),
        blur: blur.points.iter().map(|p| [p.slices, p.radius_px].map(|value| rounded(value, 3))).collect(),
        blur_floor_px: stage.blur_floor_px,
        learned_mm: of_range(0.5 * verdict::learned(found) * range_mm),
        robust_mm: of_error(held_out.robust_mm),
        rms_mm: of_error(held_out.rms_mm),
        bias_mm: of_error(held_out.bias_mm),
        slope: rounded(held_out.slope, 4),
        fill: rounded(held_out.fill, 4),
        within_three: rounded(held_out.within_three, 4),
        scatter: rounded(held_out.scatter, 3),
        residual_mm: of_error(0.5 * residual * range_mm),
        pairs: held_out.pairs,
        response: stage.curve().map(|pair| pair.map(|depth| rounded(depth, 4))).to_vec(),
        by_depth: held_out
            .by_depth
            .iter()
            .map(|at| AtDepth {
                depth: rounded(at.depth, 3),
                bias_mm: of_error(at.bias_mm),
                rms_mm: of_error(at.rms_mm),
                predicted_mm: of_error(at.predicted_mm),
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests;
