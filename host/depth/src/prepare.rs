//! What a pair goes through before depth, so that both images are of one scene, one place and one brightness.
//!
//! 1. The camera's dark and flat frames are taken off ([`CameraFrames`]).
//! 2. Saturated, black, bad and missing pixels are corrected where they are single, and left out where they do not.
//! 3. Lens distortion is taken out of both, where the optics name one.
//! 4. The near image is laid on the far one ([`align`]): by the magnification that follows from the optics of a lens that is
//!    not telecentric, and by what is measured.
//! 5. Both are brought to one brightness ([`balance`]), without bands of a lamp that flickers.
//! 6. What moved between the exposures is marked, and a pair of different scenes is refused ([`agreement`]).
//!
//! By default ([`Align::Auto`], [`Balance::Auto`]) it corrects only significant differences; a good pair is unchanged.

pub mod agreement;
pub mod align;
pub mod balance;
pub(crate) mod band;
mod bands;
mod camera;
mod defects;
mod mismatch;
pub mod noise;
mod registration;
mod straight;
mod thinned;
pub mod warp;

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::brightness;
use crate::optics::{Distortion, Optics, OpticsError};
use crate::reason::Reason;
use balance::Gain;
use bands::Bands;
use noise::{Blocks, PairNoise};
use registration::{LEAST_DISPLACEMENT_PX, model};
use thinned::Thinned;
use warp::Warp;

pub(crate) use defects::usual_magnitude;
pub(crate) use registration::Registration;

pub use camera::{CameraError, CameraFrames, check_saturation};
pub use defects::erase_wild;
pub use mismatch::Mismatch;
pub use straight::straightened;

/// A displacement below this many standard errors counts as none.
const SIGNIFICANT: f64 = 5.0;
/// Difference of brightness below which a pair is not changed: 0.5 % costs 0.05 mm in squares on the thesis' rig.
const LEAST_GAIN: f64 = 0.005;
/// Correlation relative to what noise allows below which the images show different scenes.
const UNRELATED: f64 = 0.3;
/// Part of the windows that must have detail for that verdict.
const TELLING: f64 = 0.05;

/// Registers the near image to the far one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Align {
    /// As the optics say, and a similarity where one is found for certain.
    #[default]
    Auto,
    /// Not at all.
    None,
    /// By the magnification that follows from the optics, which then are not telecentric.
    Optics,
    /// By a shift.
    Shift,
    /// By shift, magnification and rotation.
    Similarity,
    /// By any affine map.
    Affine,
}

/// How both images are brought to one brightness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Balance {
    /// By a gain, or one that varies, where one is found for certain.
    #[default]
    Auto,
    /// Not at all.
    None,
    /// By one gain.
    Gain,
    /// By a gain that varies slowly over the field.
    Local,
}

macro_rules! named {
    ($type:ident, $error:ident, $($name:literal => $variant:ident),+) => {
        /// A name that belongs to no way of doing it.
        #[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
        #[error("expected one of {}", [$($name),+].join(", "))]
        pub struct $error;

        impl FromStr for $type {
            type Err = $error;

            fn from_str(text: &str) -> Result<Self, $error> {
                match text.trim() {
                    $($name => Ok(Self::$variant),)+
                    _ => Err($error),
                }
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self {
                    $(Self::$variant => $name,)+
                })
            }
        }
    };
}
named!(Align, UnknownAlign, "auto" => Auto, "none" => None, "optics" => Optics, "shift" => Shift, "similarity" => Similarity, "affine" => Affine);
named!(Balance, UnknownBalance, "auto" => Auto, "none" => None, "gain" => Gain, "local" => Local);

/// Corrections of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PrepareSettings {
    /// Geometry.
    pub align: Align,
    /// Brightness.
    pub balance: Balance,
    /// The values at which the camera clips, black and white, where that is known.
    pub limits: Option<[f32; 2]>,
    /// Keep what moved between the exposures and pairs of different scenes.
    pub trust: bool,
    /// The noise of the pair once its brightness is balanced, if known; otherwise it is measured.
    pub noise: Option<PairNoise>,
    /// Variance of a pixel by lossy compression, in the images' units; 0 without.
    pub coding: f64,
}

/// Why a pair is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum PrepareError {
    #[error(transparent)]
    Pair(#[from] crate::pipeline::RunError),
    #[error(
        "the images do not show the same scene: the detail that defocus leaves in both has a correlation of {correlation:.2}, a pair \
         has 0.8 to 1{}",
        because.map_or("", Mismatch::words)
    )]
    Unrelated {
        /// Correlation relative to what noise allows.
        correlation: f64,
        /// What would make them a pair.
        because: Option<Mismatch>,
    },
    #[error(transparent)]
    Optics(#[from] OpticsError),
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// Geometry of the near image relative to the far one, which was corrected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aligned {
    /// Shift of the image's middle, right and down, px.
    pub shift_px: [f64; 2],
    /// Size of the near image relative to the far one.
    pub magnification: f64,
    /// Rotation from x towards y, degrees.
    pub rotation_deg: f64,
    /// Root mean square of how far pixels were moved.
    pub displacement_px: f64,
    /// Its standard error, where it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error_px: Option<f64>,
}

/// How brightness was brought to one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Balanced {
    /// Brightness of the near image relative to the far one, mean over the field.
    pub gain: f64,
    /// Its smallest and largest over the field, where it varied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
}

/// Report of the preparation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Report {
    /// `None` for unchanged geometry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aligned: Option<Aligned>,
    /// `None` for unchanged brightness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub balanced: Option<Balanced>,
    /// Largest deviation from 1 of a row's or column's relative brightness that was divided out; `None` without bands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<f64>,
    /// Correlation of what both images share, relative to what noise allows; `None` where nothing rises above it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correlation: Option<f64>,
    /// Part of the image in which both have detail above the noise.
    pub detailed_fraction: f64,
    /// Both images differ by noise alone: a plane in the middle of the range, or the focus did not move.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub equally_sharp: bool,
    /// Part of the pixels that show something else in each image.
    pub moved_fraction: f64,
    /// Part of the pixels that show the same in both images with more blur than a pair has.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub too_blurred_fraction: f64,
    /// Part of the pixels that are saturated in at least one image.
    pub saturated_fraction: f64,
    /// Whether the near image is magnified as by a lens that is not telecentric, though the optics do not say so.
    pub looks_not_telecentric: bool,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A pair that is ready.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The far image; NaN where a pixel says nothing.
    pub far: Array2<f32>,
    /// The near image, as seen from the far one.
    pub near: Array2<f32>,
    /// Code of the [`Reason`] for each pixel that says nothing or was corrected, 0 for the others.
    pub reasons: Array2<u8>,
    /// The noise of the images as they are here, except for interpolation.
    pub noise: PairNoise,
    /// Report of the preparation.
    pub report: Report,
}

/// Makes the images `[far, near]`, (height, width), of any common scale, ready for depth. Nothing is copied that need not be,
/// which counts where a map is as large as a machine's memory allows.
///
/// # Errors
/// [`PrepareError`] for images of different size, of different scenes, and for frames of another camera.
pub fn prepare(
    images: [Array2<f32>; 2],
    optics: &Optics,
    camera: Option<&CameraFrames>,
    settings: &PrepareSettings,
) -> Result<Prepared, PrepareError> {
    // On a thread of the pool: another one would wake the pool for each parallel loop.
    rayon::scope(|_| prepare_after(&mut None, images, optics, camera, settings))
}

/// [`prepare`] of the next pair of a rig. Reuses the registration of the `last` pair if it fits, else registers again.
pub(crate) fn prepare_after(
    last: &mut Option<Registration>,
    [mut far, mut near]: [Array2<f32>; 2],
    optics: &Optics,
    camera: Option<&CameraFrames>,
    settings: &PrepareSettings,
) -> Result<Prepared, PrepareError> {
    let size = far.dim();
    check_sizes(size, near.dim())?;
    if let Some(frames) = camera {
        [&far, &near].into_iter().try_for_each(|image| frames.check(image.view()))?;
    }
    let bad = camera.and_then(CameraFrames::bad);
    let find = |image: &Array2<f32>| defects::find(image.view(), settings.limits, bad);
    let marks: [_; 2] = rayon::join(|| find(&far), || find(&near)).into();
    for (image, marks) in [&mut far, &mut near].into_iter().zip(&marks) {
        if let Some(frames) = camera {
            *image = frames.apply(image.view());
        }
        if let Some(marks) = marks {
            defects::mend(image, marks);
        }
    }
    // Interpolation takes noise away, so it is measured before.
    let blocks = match settings.noise {
        Some(_) => Blocks::default(),
        None => Blocks::of(far.view(), near.view()),
    };
    let Some(distortion) = optics.distortion() else {
        return finish(last, [far, near], None, marks, &blocks, optics, settings);
    };
    let recorded = Recorded { near: near.clone(), distortion };
    let marks = marks.map(|marks| Some(straight::reasons(marks.as_ref(), size, &distortion)));
    let shows = |image: &Array2<f32>| image.iter().any(|value| value.is_finite());
    let had_shown = shows(&far) && shows(&near);
    let pair = [far, near].map(|image| straightened(image.view(), &distortion));
    if had_shown && !pair.iter().all(shows) {
        let ([cx, cy], (height, width)) = (distortion.centre_px(), size);
        return Err(OpticsError::NothingStraight { cx, cy, width, height }.into());
    }
    finish(last, pair, Some(recorded), marks, &blocks, optics, settings)
}

/// The near image as the lens recorded it: aligning it interpolates it once, not twice.
struct Recorded {
    near: Array2<f32>,
    distortion: Distortion,
}

fn check_sizes(
    (far_height, far_width): (usize, usize),
    (near_height, near_width): (usize, usize),
) -> Result<(), PrepareError> {
    if (far_height, far_width) == (near_height, near_width) {
        return Ok(());
    }
    Err(crate::pipeline::RunError::SizeMismatch { far_width, far_height, near_width, near_height }.into())
}

/// What follows once single pixels are corrected and lines are straight: geometry, brightness, agreement.
fn finish(
    last: &mut Option<Registration>,
    [far, near]: [Array2<f32>; 2],
    recorded: Option<Recorded>,
    marks: [Option<Array2<u8>>; 2],
    blocks: &Blocks,
    optics: &Optics,
    settings: &PrepareSettings,
) -> Result<Prepared, PrepareError> {
    let is_first = last.is_none();
    let size = far.dim();
    let mut report = Report::default();
    let moved = |warp: Warp| match &recorded {
        Some(Recorded { near, distortion }) => {
            warp::resample_by(near.view(), |place| distortion.distorted(warp.at(place)))
        }
        None => warp::resample(near.view(), &warp),
    };
    let of_last =
        last.filter(|last| last.size == size).zip(model(settings.align)).and_then(|(last, model)| {
            let moved = last.warp.map(moved);
            let thinned = Thinned::new(far.view(), moved.as_ref().unwrap_or(&near).view());
            align::stays(&thinned, model, size, LEAST_DISPLACEMENT_PX).then_some((last, moved, thinned))
        });
    let (registration, moved, mut thinned) = of_last.unwrap_or_else(|| {
        let mut thinned = Thinned::new(far.view(), near.view());
        let registration = Registration::find(&thinned, size, optics, settings.align);
        let moved = registration.warp.map(moved);
        if let Some(moved) = &moved {
            thinned.replace_near(moved.view());
        }
        (registration, moved, thinned)
    });
    *last = Some(registration);
    (report.aligned, report.looks_not_telecentric) =
        (registration.aligned, registration.looks_not_telecentric);
    let (warp, mut near) = (registration.warp, moved.unwrap_or(near));
    drop(recorded);
    brightness(&far, &mut near, &mut thinned, settings.balance, &mut report);
    let marked = marks.iter().any(Option::is_some);
    let mut reasons = merged(marks, warp.as_ref(), &near);
    if marked {
        report.saturated_fraction = part_of(&reasons, Reason::Saturated);
    }
    let gain = report.balanced.map_or(1.0, |balanced| balanced.gain);
    let noise = settings.noise.or_else(|| blocks.noise(gain)).unwrap_or_default();
    let noise = if settings.coding > 0.0 {
        // Balancing amplifies the coding's error in a darker near image.
        noise.coded(settings.coding * gain.min(1.0).powi(-2), brightness::mean(far.view()))
    } else {
        noise
    };
    let agreement = agreement::compare(&thinned, size, &noise);
    drop(thinned);
    report.equally_sharp = agreement.equally_sharp;
    (report.correlation, report.detailed_fraction) = (agreement.correlation, agreement.detailed);
    let mut far = far;
    if !settings.trust {
        if let Some(correlation) =
            agreement.correlation.filter(|c| *c < UNRELATED && agreement.detailed > TELLING)
        {
            // Pairs of a stream have no time for it.
            let because =
                is_first.then(|| Mismatch::of(&far, &near, correlation, optics, settings)).flatten();
            return Err(PrepareError::Unrelated { correlation, because });
        }
        let of_moved = (&agreement.moved, Reason::Moved, &mut report.moved_fraction);
        let of_blurred = (&agreement.too_blurred, Reason::Misfit, &mut report.too_blurred_fraction);
        for (mask, reason, fraction) in [of_moved, of_blurred] {
            let Some(mask) = mask else { continue };
            for (at, _) in mask.indexed_iter().filter(|(_, differs)| **differs) {
                if reasons[at] == 0 {
                    reasons[at] = reason.code();
                }
                (far[at], near[at]) = (f32::NAN, f32::NAN);
            }
            *fraction = part_of(&reasons, reason);
        }
    }
    Ok(Prepared { far, near, reasons, noise, report })
}

fn part_of(reasons: &Array2<u8>, reason: Reason) -> f64 {
    reasons.iter().filter(|code| **code == reason.code()).count() as f64 / reasons.len() as f64
}

fn brightness(
    far: &Array2<f32>,
    near: &mut Array2<f32>,
    thinned: &mut Thinned,
    balance: Balance,
    report: &mut Report,
) {
    if balance == Balance::None {
        return;
    }
    let Some(mut gain) = Gain::measure(far.view(), near.view()) else { return };
    if balance == Balance::Auto && gain.left_over[1] > LEAST_GAIN {
        report.bands = even_bands(near, thinned);
        if report.bands.is_some() {
            let Some(evened) = Gain::measure(far.view(), near.view()) else { return };
            gain = evened;
        }
    }
    let varies = match balance {
        Balance::Auto => gain.varies(LEAST_GAIN),
        other => other == Balance::Local,
    };
    let differs = (gain.mean - 1.0).abs() > LEAST_GAIN.max(SIGNIFICANT * gain.standard_error);
    if varies {
        gain.divide_by_field(&mut near.view_mut());
        gain.divide_by_field(&mut thinned.near.band.view_mut());
        report.balanced = Some(Balanced { gain: gain.mean, range: Some(gain.range) });
    } else if differs || balance == Balance::Gain {
        gain.divide_by_mean(&mut near.view_mut());
        gain.divide_by_mean(&mut thinned.near.band.view_mut());
        report.balanced = Some(Balanced { gain: gain.mean, range: None });
    }
}

/// Divides bands along rows, then along columns, out of the near image. Returns their largest deviation from 1.
fn even_bands(near: &mut Array2<f32>, thinned: &mut Thinned) -> Option<f64> {
    let scale = 1 << thinned.halvings;
    let [far, small] = [&thinned.far, &thinned.near].map(|small| small.image.view());
    let rows = Bands::measure(far, small, LEAST_GAIN);
    if let Some(bands) = &rows {
        bands.divide(near.view_mut(), scale);
        thinned.replace_near(near.view());
    }
    let [far, small] = [&thinned.far, &thinned.near].map(|small| small.image.t());
    let columns = Bands::measure(far, small, LEAST_GAIN);
    if let Some(bands) = &columns {
        bands.divide(near.view_mut().reversed_axes(), scale);
        thinned.replace_near(near.view());
    }
    [rows, columns].into_iter().flatten().map(|bands| bands.amplitude).reduce(f64::max)
}

/// The reasons of both images in the far one's pixels, and the edge that the near image does not reach.
fn merged(marks: [Option<Array2<u8>>; 2], warp: Option<&Warp>, near: &Array2<f32>) -> Array2<u8> {
    let [far_marks, near_marks] = marks;
    let (height, width) = near.dim();
    let mut reasons = far_marks.unwrap_or_else(|| Array2::zeros((height, width)));
    let Some(warp) = warp else {
        if let Some(marks) = &near_marks {
            reasons.zip_mut_with(marks, |to, mark| *to = if *to == 0 { *mark } else { *to });
        }
        return reasons;
    };
    reasons.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(y, mut row)| {
        let source = |x: usize| {
            let [px, py] = warp.at([x as f64, y as f64]).map(f64::round);
            let inside = px >= 0.0 && py >= 0.0 && px < width as f64 && py < height as f64;
            inside.then_some((py as usize, px as usize))
        };
        // An affine map sends one stretch of a row into the image.
        let from = (0..width).find(|x| source(*x).is_some()).unwrap_or(width);
        let to = (from..width).rev().find(|x| source(*x).is_some()).map_or(from, |last| last + 1);
        let or = |reason: &mut u8, other: u8| *reason = if *reason == 0 { other } else { *reason };
        (0..from).chain(to..width).for_each(|x| or(&mut row[x], Reason::Edge.code()));
        if let Some(marks) = &near_marks {
            (from..to).for_each(|x| or(&mut row[x], source(x).map_or(0, |at| marks[at])));
        }
    });
    reasons
}
