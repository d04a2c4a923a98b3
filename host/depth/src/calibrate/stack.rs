//! A depth camera from one z-stack of a flat, textured target.
//!
//! 1. [`focus_plane`]: depth from focus per block gives the slice in focus at each pixel, a plane.
//! 2. [`blur`]: spectra of each slice against the sharpest give blur over distance, on both sides of focus.
//! 3. Pair separation and binning for a largest blur of 2 to 3 px.
//! 4. Every pair (i, i + d) is measured with several PSFs, blur radii and least blurs. A polynomial response from
//!    measured to true normalised depth is fitted on one half of the field in every other pair. The other parts select
//!    the model and give the remaining error, which enters every later standard deviation.
//!
//! A stage that moves the target gives relative distances: the far plane is at [`Moved::Target::far_mm`], and depth falls
//! by one step per slice. A stage that moves the sensor of a known lens gives distances by the lens equation.

mod astigmatism;
pub mod blur;
mod curve;
mod fixed_pattern;
pub mod focus_plane;
mod foreign;
mod held_out;
mod response;

use ndarray::Array2;

use crate::brightness;
use crate::measure::binned;
use crate::optics::{FocusSection, LensSection, Optics, OpticsFile, SensorSection, Stage};
use crate::psf::Psf;
use crate::slice_order;
use astigmatism::FocusByDirection;
use blur::BlurCurve;
use focus_plane::{FocusPlane, Slices};

pub use held_out::{AtDepth, HeldOut};
pub use response::{LENSES, Trial};

/// Target blur radius, px, of the far plane in the near image.
const AIM_PX: f64 = 2.5;
/// Blur radii that are usable.
const USABLE_PX: [f64; 2] = [1.6, 3.4];
const BINS: [usize; 4] = [1, 2, 4, 8];
/// Depths within the range at which enough pairs see the target to learn a response.
const ENOUGH_DEPTHS: usize = 4;
/// Largest spread of the blocks' focus around the plane, in pair steps.
const FLAT: f64 = 0.15;
/// Pitch of the sensor, which a stack does not tell; with the magnification it gives the pixel at the target.
const ANY_PIXEL_UM: f64 = 5.0;
/// Magnification where the pixel at the target is unknown.
const ANY_MAGNIFICATION: f64 = 3.0 / 7.0;
/// Ranges of a pair between the front focus and the far plane: depth is nearly linear in alpha.
const FAR_RANGES: f64 = 140.0;
/// Least side of a binned image, px.
const LEAST_SIDE: usize = 64;
/// Fewest slices.
pub const FEWEST: usize = 5;

/// How a stack is calibrated.
#[derive(Debug, Clone, PartialEq)]
pub struct StackSettings {
    /// Distance between neighbouring slices.
    pub step_mm: f64,
    /// What the stage moves.
    pub moved: Moved,
    /// Slices between the images of a pair; `None` chooses.
    pub pair_step: Option<usize>,
    /// Binning; `None` chooses.
    pub bin: Option<usize>,
    /// Variance of a pixel by lossy compression, in the slices' units; 0 without.
    pub coding: f64,
}

/// What the stage moves between the slices.
#[derive(Debug, Clone, PartialEq)]
pub enum Moved {
    /// The target towards the camera, or the whole camera towards the target.
    Target {
        /// Side of a pixel at the target, in thousandths of the steps' unit; `None` if unknown.
        object_pixel_um: Option<f64>,
        /// Distance of the far plane; `None` is far beyond the range of a pair, where only relative depth is known.
        far_mm: Option<f64>,
    },
    /// The sensor away from this lens. Its far plane, focal length and pixel pitch are kept.
    Sensor(Box<Optics>),
}

/// Why a stack gives no lens.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum StackError {
    #[error("{0} slices: at least {FEWEST} are needed, from in front of the focus to behind it")]
    TooFew(usize),
    #[error(
        "slice {number} has {width}x{height} px and the first one {}x{}: all must have one size; crop them alike", of.1, of.0
    )]
    Size {
        number: usize,
        width: usize,
        height: usize,
        /// The first one's (height, width).
        of: (usize, usize),
    },
    #[error("{name} = {value}: expected a positive number")]
    NotPositive { name: &'static str, value: f64 },
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange { name: &'static str, value: usize, expected: String },
    #[error(
        "far_mm = {far_mm}: a pair ({pair_step} steps of {step_mm}) spans {range_mm:.3}, so the far plane is at more than {least_mm:.3}; give \
         its distance from the lens in the unit of the steps, or leave far_mm out"
    )]
    FarTooNear { far_mm: f64, pair_step: usize, step_mm: f64, range_mm: f64, least_mm: f64 },
    #[error(
        "{blocks} of {of} blocks are sharpest inside the stack: the target must be textured, and the stack must go through its \
         focus"
    )]
    NoFocus { blocks: usize, of: usize },
    #[error(
        "no pair of slices has a largest blur of {low} to {high} px: it is {per_slice:.2} px per slice{given}; use {hint}",
        low = USABLE_PX[0],
        high = USABLE_PX[1]
    )]
    NoSeparation { per_slice: f64, given: String, hint: String },
    #[error("no pair of slices {0} apart has its target within the range: take more slices around the focus")]
    NoPair(usize),
    #[error(
        "the target is not flat: its parts are in focus {spread:.2} slices (SD) from their common plane, at most {limit:.2} is \
         usable for pairs {pair_step} slices apart; use a flat, textured target, or a part of the images that is flat"
    )]
    NotFlat { spread: f64, limit: f64, pair_step: usize },
    #[error("stopped")]
    Stopped,
    #[error(transparent)]
    Optics(#[from] crate::optics::OpticsError),
}

/// Result of the calibration.
#[derive(Debug, Clone)]
pub struct StackLens {
    /// For measuring pairs by operators with a white residual.
    pub optics: Optics,
    /// Where the target is in focus.
    pub plane: FocusPlane,
    /// Blur over distance, in unbinned px.
    pub blur: BlurCurve,
    /// How well held-out parts are measured.
    pub held_out: HeldOut,
    /// All that was tried, the best first.
    pub trials: Vec<Trial>,
    /// A slice that does not fit the others (defocused, exchanged, of something else), or two of which one does not.
    pub foreign: Vec<usize>,
    /// Slices that look exchanged.
    pub exchanged: Vec<[usize; 2]>,
    /// The first slice, if the order looks wrapped.
    pub wrapped: Option<usize>,
    /// Part of the sharpest slice's finest detail that is also in the most defocused slices: of the camera, not of the target.
    pub fixed_pattern: Option<f64>,
}

/// Calibrates from `slices`, the far-focused first, (height, width). `proceed` is called before each measurement of a pair with
/// the number of lenses tried, of [`LENSES`]; when it returns false the result is [`StackError::Stopped`]. Cost: two
/// measurements of every pair that sees the target for each lens.
pub fn calibrate_stack(
    slices: &[Array2<f32>],
    settings: &StackSettings,
    proceed: &(dyn Fn(usize) -> bool + Sync),
) -> Result<StackLens, StackError> {
    check(slices, settings)?;
    let not_stopped = || proceed(0);
    let evened = brightness::evened(slices);
    let of_focus = Slices::new(&evened);
    let plane = of_focus.plane(&not_stopped)?;
    let blur = BlurCurve::of(&evened, &plane, &not_stopped)?;
    let by_direction = FocusByDirection::of(&of_focus, &not_stopped)?;
    drop(evened);
    let (bin, pair_step) = separation(&blur, slices.len(), largest_bin(slices[0].dim()), settings)?;
    let limit = FLAT * pair_step as f64;
    if plane.spread > limit {
        return Err(StackError::NotFlat { spread: plane.spread, limit, pair_step });
    }
    let small: Vec<Array2<f32>> = slices.iter().map(|slice| binned(slice.clone(), bin)).collect();
    let plane_of_bins = plane.binned(bin);
    let radius = (blur.px_per_slice() * pair_step as f64 / bin as f64).clamp(1.0, 4.0);
    let optics_of = |psf: Psf, max_blur_px: f64| optics(psf, max_blur_px, bin, pair_step, settings);
    let truth_of = |optics: &Optics, place: f64| match settings.moved {
        // Steps of the target are equal in depth, those of the sensor in normalised depth.
        Moved::Target { .. } => {
            let range = optics.working_range();
            optics.alpha(range.far_mm - 0.5 * (1.0 + place) * settings.step_mm * pair_step as f64)
        }
        Moved::Sensor(_) => place,
    };
    let response::Learned { optics, held_out, trials, foreign } = response::learn(&response::Target {
        slices: &small,
        plane: &plane_of_bins,
        by_direction: by_direction.map(|focus| focus.of_pairs(pair_step)),
        pair_step,
        bin,
        coding: settings.coding / (bin * bin) as f64,
        radius_px: radius,
        optics_of: &optics_of,
        truth_of: &truth_of,
        proceed,
    })?;
    let scale_known = match &settings.moved {
        Moved::Target { object_pixel_um, .. } => object_pixel_um.is_some(),
        Moved::Sensor(lens) => lens.stage().is_none_or(|stage| stage.scale_known),
    };
    let (height, width) = slices[0].dim();
    let optics = match optics.stage().copied() {
        Some(stage) => optics.with_stage(Stage { scale_known, image_px: Some([width, height]), ..stage }),
        None => optics,
    };
    let sharpness: Vec<Vec<f64>> = slices
        .iter()
        .map(|slice| not_stopped().then(|| slice_order::sharpness(slice.view())))
        .collect::<Option<_>>()
        .ok_or(StackError::Stopped)?;
    let sharpness = slice_order::comparable(&sharpness);
    let (exchanged, wrapped) = (slice_order::exchanged(&sharpness), slice_order::wrapped(&sharpness));
    let sharpest = plane.at(0.5 * height as f64, 0.5 * width as f64).round().max(0.0) as usize;
    let fixed_pattern = fixed_pattern::find(slices, sharpest.min(slices.len() - 1));
    Ok(StackLens { optics, plane, blur, held_out, trials, foreign, exchanged, wrapped, fixed_pattern })
}

fn check(slices: &[Array2<f32>], settings: &StackSettings) -> Result<(), StackError> {
    if slices.len() < FEWEST {
        return Err(StackError::TooFew(slices.len()));
    }
    let of = slices[0].dim();
    if let Some(index) = slices.iter().position(|slice| slice.dim() != of) {
        let (number, (height, width)) = (index + 1, slices[index].dim());
        return Err(StackError::Size { number, width, height, of });
    }
    let (object_pixel_um, far_mm) = match &settings.moved {
        Moved::Target { object_pixel_um, far_mm } => (*object_pixel_um, *far_mm),
        Moved::Sensor(_) => (None, None),
    };
    let numbers =
        [("step_mm", Some(settings.step_mm)), ("object_pixel_um", object_pixel_um), ("far_mm", far_mm)];
    for (name, value) in numbers {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
            return Err(StackError::NotPositive { name, value });
        }
    }
    let (height, width) = slices[0].dim();
    let largest_bin = largest_bin((height, width));
    let counts = [("bin", settings.bin, largest_bin), ("pair_step", settings.pair_step, slices.len() - 2)];
    for (name, value, most) in counts {
        if let Some(value) = value.filter(|value| !(1..=most).contains(value)) {
            let expected = format!("1 to {most} for {} slices of {width}x{height}", slices.len());
            return Err(StackError::OutOfRange { name, value, expected });
        }
    }
    Ok(())
}

/// Largest accepted binning of images of (height, width).
fn largest_bin((height, width): (usize, usize)) -> usize {
    (height.min(width) / LEAST_SIDE).clamp(1, Stage::LARGEST_BIN)
}

/// Binning and separation whose largest blur is nearest to [`AIM_PX`]; small bins first. Separations are at least
/// [`ENOUGH_DEPTHS`] slices: with n slices, n pairs see the target within their range.
fn separation(
    blur: &BlurCurve,
    slices: usize,
    largest_bin: usize,
    settings: &StackSettings,
) -> Result<(usize, usize), StackError> {
    let per_slice = blur.px_per_slice();
    let bins = settings.bin.map_or(BINS.to_vec(), |bin| vec![bin]);
    let most = (slices - 1) / 2;
    let steps = settings.pair_step.map_or((1..=most.max(1)).collect(), |step| vec![step]);
    let forced = settings.bin.is_some() && settings.pair_step.is_some();
    let radius_px = |bin: usize, step: usize| per_slice * step as f64 / bin as f64;
    let is_usable = |bin: usize, step: usize| (USABLE_PX[0]..=USABLE_PX[1]).contains(&radius_px(bin, step));
    bins.iter()
        .flat_map(|bin| steps.iter().map(move |step| (*bin, *step)))
        .filter(|(bin, step)| forced || is_usable(*bin, *step))
        .min_by(|a, b| {
            let cost = |(bin, step): &(usize, usize)| {
                let missing = ENOUGH_DEPTHS.saturating_sub(*step) as f64;
                (radius_px(*bin, *step) - AIM_PX).abs() + 0.3 * (*bin as f64).log2() + 0.5 * missing
            };
            cost(a).total_cmp(&cost(b))
        })
        .ok_or_else(|| {
            let named =
                |name: &str, value: Option<usize>| value.map(|value| format!(" with {name} = {value}"));
            let given = [named("bin", settings.bin), named("pair_step", settings.pair_step)];
            let (name, usable): (_, Vec<usize>) = match (settings.bin, settings.pair_step) {
                (None, None) => ("", Vec::new()),
                (None, Some(_)) => {
                    let is_usable = |step: &usize| BINS.iter().any(|bin| is_usable(*bin, *step));
                    ("pair_step", (1..=slices - 2).filter(is_usable).collect())
                }
                (Some(_), _) => {
                    let is_usable = |bin: &usize| (1..=most).any(|step| is_usable(*bin, step));
                    ("bin", (1..=largest_bin).filter(is_usable).collect())
                }
            };
            // Whether one is found if it is left out.
            let is_found = BINS.iter().any(|bin| (1..=most).any(|step| is_usable(*bin, step)));
            let or = if is_found { ", or leave it out" } else { "" };
            let hint = match usable[..] {
                [one] => format!("{name} = {one}{or}"),
                [least, .., most] => format!("{name} = {least} to {most}{or}"),
                [] if per_slice > 1.0 => "a finer step of the stage".into(),
                [] => "a coarser step of the stage, more slices, or a target with finer, irregular texture"
                    .into(),
            };
            StackError::NoSeparation { per_slice, given: given.into_iter().flatten().collect(), hint }
        })
}

/// A thin lens whose pair spans `pair_step` slices. For a moved target only the range counts; depth is nearly linear in
/// alpha.
fn optics(
    psf: Psf,
    max_blur_px: f64,
    bin: usize,
    pair_step: usize,
    settings: &StackSettings,
) -> Result<Optics, StackError> {
    let span_mm = settings.step_mm * pair_step as f64;
    let (focal_length_mm, pixel_um, far_mm, travel_mm, telecentric) = match &settings.moved {
        Moved::Target { object_pixel_um, far_mm } => {
            let magnification =
                object_pixel_um.map_or(ANY_MAGNIFICATION, |object_um| ANY_PIXEL_UM / object_um);
            // The near plane of a nearer far plane is within the focal length.
            let least_mm = (1.0 + magnification) * span_mm;
            let far_mm = far_mm.unwrap_or(FAR_RANGES * least_mm);
            if far_mm <= least_mm {
                let (step_mm, range_mm) = (settings.step_mm, span_mm);
                return Err(StackError::FarTooNear { far_mm, pair_step, step_mm, range_mm, least_mm });
            }
            let focal_length_mm = far_mm * magnification / (1.0 + magnification);
            let image = |u: f64| focal_length_mm * focal_length_mm / (u - focal_length_mm);
            (focal_length_mm, ANY_PIXEL_UM, far_mm, image(far_mm - span_mm) - image(far_mm), Some(true))
        }
        Moved::Sensor(lens) => {
            let lens = lens.unbinned();
            let far_mm = lens.working_range().far_mm;
            (lens.focal_length_mm(), lens.pixel_um(), far_mm, span_mm, lens.telecentric())
        }
    };
    let pixel_um = pixel_um * bin as f64;
    let cone_mm = match telecentric {
        Some(false) => focal_length_mm * far_mm / (far_mm - focal_length_mm) + 0.5 * travel_mm,
        Some(true) | None => focal_length_mm,
    };
    let f_number = travel_mm / (2.0 * max_blur_px * pixel_um * 1e-3) * focal_length_mm / cone_mm;
    let file = OpticsFile {
        lens: LensSection { focal_length_mm, aperture_mm: None, f_number: Some(f_number), telecentric },
        sensor: SensorSection { pixel_um },
        focus: FocusSection { far_mm, max_blur_px: Some(max_blur_px), near_mm: None },
        psf,
        distortion: None,
        stage: None,
        light: None,
    };
    Ok(file.check()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_of_other_sizes_are_refused_by_their_sizes() {
        let mut slices = vec![Array2::<f32>::zeros((80, 96)); FEWEST];
        slices[3] = Array2::zeros((80, 90));
        let moved = Moved::Target { object_pixel_um: None, far_mm: None };
        let settings = StackSettings { step_mm: 0.5, moved, pair_step: None, bin: None, coding: 0.0 };
        let error = check(&slices, &settings).unwrap_err().to_string();
        assert!(error.contains("slice 4 has 90x80 px and the first one 96x80"), "{error}");
    }

    #[test]
    fn an_unusable_pair_step_or_bin_is_refused_with_the_usable_ones() {
        let moved = Moved::Target { object_pixel_um: None, far_mm: None };
        let usual = StackSettings { step_mm: 0.5, moved, pair_step: None, bin: None, coding: 0.0 };
        for (per_slice, given, phrase) in [
            (
                0.25,
                StackSettings { pair_step: Some(6), ..usual.clone() },
                "use pair_step = 7 to 19, or leave it out",
            ),
            (0.25, StackSettings { bin: Some(3), ..usual.clone() }, "use bin = 1, or leave it out"),
            (4.0, StackSettings { bin: Some(1), ..usual.clone() }, "use bin = 2 to 16, or leave it out"),
            // More slices apart than are tried, and more pixels.
            (0.1, StackSettings { pair_step: Some(6), ..usual.clone() }, "use pair_step = 16 to 19"),
            (40.0, StackSettings { bin: Some(1), ..usual.clone() }, "use bin = 12 to 16"),
            (0.01, usual.clone(), "more slices, or a target with finer, irregular texture"),
            (
                0.01,
                StackSettings { bin: Some(1), ..usual.clone() },
                "use a coarser step of the stage, more slices, or a target with finer, irregular texture",
            ),
            (99.0, usual.clone(), "use a finer step of the stage"),
        ] {
            let blur = BlurCurve { points: Vec::new(), per_slice_px: [per_slice; 2] };
            let error = separation(&blur, 21, 16, &given).unwrap_err().to_string();
            assert!(error.ends_with(phrase), "{error}");
        }
    }

    #[test]
    fn a_far_plane_within_the_range_of_a_pair_is_refused() {
        let of = |far_mm: f64| {
            let moved = Moved::Target { object_pixel_um: None, far_mm: Some(far_mm) };
            let settings = StackSettings { step_mm: 0.5, moved, pair_step: None, bin: None, coding: 0.0 };
            optics(Psf::PillBox, 2.5, 1, 4, &settings)
        };
        for far_mm in [1.0, 2.0, 2.8] {
            let error = of(far_mm).unwrap_err().to_string();
            let phrases =
                [format!("far_mm = {far_mm}:"), "4 steps of 0.5) spans 2.000".into(), "2.857".into()];
            assert!(phrases.iter().all(|phrase| error.contains(phrase)), "{error}");
        }
        assert!(of(3.0).is_ok() && of(900.0).is_ok());
    }
}
