//! Which PSF, blur and response fit the target, learned on one part of it and tested on the rest. A checkerboard of
//! blocks decides the choices. The stated error is stricter: half of the field in every other pair is tested with the
//! response of the other half in the other pairs, at other places and distances. The target is tested again with
//! coarser texture, on which no choice may depend.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use ndarray::Array2;

use super::StackError;
use super::astigmatism::FocusByDirection;
use super::curve::Curve;
use super::focus_plane::FocusPlane;
use super::foreign;
use super::held_out::{HeldOut, Judged, Split, finish, judge, robust};
use crate::adaptive_window::{Bank, LEARNED_PX, Window};
use crate::coarseness::coarseness;
use crate::direction::anisotropy;
use crate::measure::{DepthMethod, MeasureSettings, measure};
use crate::median::median;
use crate::optics::{Optics, Stage};
use crate::pipeline::Settings;
use crate::prepare::{PrepareSettings, Prepared, band::binomial, prepare};
use crate::psf::Psf;

/// Side of a checkerboard block, px: larger than the windows' reach.
const BLOCK_PX: usize = 48;
/// Ignored border, px.
const BORDER_PX: usize = 12;
/// One of this many pixels is used, along both axes.
const THIN: usize = 5;
/// Places between the slices of a pair that are learned; a little beyond the range.
pub(super) const LEARNED: f64 = 1.12;
/// Standard deviation of normalised depth by noise beyond which a pixel has no depth.
const TOO_NOISY: f64 = 0.12;
/// Lenses that are tried.
pub const LENSES: usize = PSFS.len() * FACTORS.len() + 2 * FLOORS_PX.len() + 3;
const PSFS: [Psf; 4] = [
    Psf::PillBox,
    Psf::Generalised { p: 3.0, k: 0.62 },
    Psf::Gaussian { k: 0.5 },
    Psf::Generalised { p: 1.5, k: 0.42 },
];
const DEGREES: [usize; 4] = [1, 2, 3, 5];
/// Blur radii relative to the measured one.
const FACTORS: [f64; 5] = [0.7, 0.85, 1.0, 1.2, 1.4];
/// Penalty of a blur that differs from the measured one, per squared logarithm of their ratio.
const UNLIKELY: f64 = 0.5;
/// Least blur radii that are tried with the best PSF, px.
const FLOORS_PX: [f64; 3] = [0.5, 0.9, 1.3];
/// Model error in the smallest adaptive window, relative to the noise there, from which windows may differ by it.
const MODEL_LIMITED: f64 = 0.5;
/// Accepted difference between windows relative to that error, which is not the same everywhere. Chosen on a metal plate.
const TOLERATED: f64 = 2.0;
/// Largest accepted difference.
const LARGEST_TOLERANCE: f64 = 0.15;
/// Largest squared error, relative to its variance, that counts: larger ones are outliers. With them the tolerance of clear
/// lenses hid relief.
const LARGEST_SQUARE: f64 = 9.0;
/// Improvement that justifies a lens with one more parameter.
pub(super) const WORTH: f64 = 0.97;
/// Part of the noise's variance that smoothing leaves: sum of the squared taps.
const SMOOTHED_NOISE: f64 = 0.0748;
/// One combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// PSF by name.
    pub psf: String,
    /// Largest blur radius, px.
    pub max_blur_px: f64,
    /// Least blur radius, px.
    pub blur_floor_px: f64,
    /// Degree of the response.
    pub degree: usize,
    /// Robust error on the held-out parts, mm.
    pub robust_mm: f64,
}

/// A pixel of a pair.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    pub measured: f64,
    pub truth: f64,
    /// Standard deviation of `measured` by noise.
    pub noise: f64,
    /// Mean square residual relative to the noise.
    pub misfit: f32,
    pub coarseness: f64,
    pub anisotropy: [f64; 2],
    /// Colour of its block on a checkerboard.
    pub even: bool,
    /// Half of the field.
    pub left: bool,
    /// Original target, not smoothed.
    pub original: bool,
    /// Far slice of its pair.
    pub far: usize,
}

#[cfg(test)]
impl Sample {
    /// Without noise.
    pub(super) fn exact(measured: f64, truth: f64) -> Self {
        Self {
            measured,
            truth,
            noise: 0.0,
            misfit: 1.0,
            coarseness: 0.0,
            anisotropy: [0.0; 2],
            even: false,
            left: false,
            original: true,
            far: 0,
        }
    }
}

pub(super) struct Samples {
    pub of: Vec<Sample>,
    pub looked_at: usize,
    pub pairs: usize,
    pub by_direction: Option<FocusByDirection>,
}

impl Samples {
    /// Leaves out an astigmatism that does not make held-out parts more accurate.
    fn confirmed(mut self, degree: usize) -> Self {
        let error = |samples: &Self| {
            let (judged, _) = judge(samples, degree, Split::Parts, false)?;
            Some(robust(judged.iter().filter(|j| j.original).map(|j| j.error)))
        };
        let with = error(&self);
        let by_direction = self.by_direction.take();
        let without = error(&self);
        if let (Some(with), Some(without)) = (with, without)
            && with <= without
        {
            self.by_direction = by_direction;
        }
        self
    }
}

struct Pair {
    far: usize,
    prepared: Prepared,
    coarseness: Array2<f32>,
    /// Where the lens has astigmatism.
    anisotropy: Option<[Array2<f32>; 2]>,
    original: bool,
}

pub(super) struct Learned {
    pub optics: Optics,
    pub held_out: HeldOut,
    pub trials: Vec<Trial>,
    pub foreign: Vec<usize>,
}

/// Slices to calibrate, binned.
pub(super) struct Target<'a> {
    pub slices: &'a [Array2<f32>],
    pub plane: &'a FocusPlane,
    /// In normalised depth.
    pub by_direction: Option<FocusByDirection>,
    pub pair_step: usize,
    pub bin: usize,
    pub coding: f64,
    /// Largest blur radius as measured, px.
    pub radius_px: f64,
    pub optics_of: &'a (dyn Fn(Psf, f64) -> Result<Optics, StackError> + Sync),
    /// True normalised depth of a lens at a place between the slices of a pair, -1 to 1.
    pub truth_of: &'a (dyn Fn(&Optics, f64) -> f64 + Sync),
    pub proceed: &'a (dyn Fn(usize) -> bool + Sync),
}

/// A lens to try.
#[derive(Clone, Copy)]
struct Candidate {
    psf: Psf,
    /// Blur relative to the measured one.
    factor: f64,
    floor_px: f64,
    /// Accepted difference between windows.
    tolerance: f64,
}

struct Best {
    cost: f64,
    lens: Candidate,
    degree: usize,
    optics: Optics,
    samples: Samples,
}

pub(super) fn learn(target: &Target<'_>) -> Result<Learned, StackError> {
    let pairs = target.pairs()?;
    let range = (target.optics_of)(Psf::PillBox, 2.0)?.working_range();
    let half_mm = 0.5 * (range.far_mm - range.near_mm);
    let mut best: Option<Best> = None;
    let mut trials = Vec::new();
    let mut tried = 0;
    let mut attempt = |lens: Candidate, window: Window, best: &mut Option<Best>| {
        let Candidate { psf, factor, floor_px, tolerance } = lens;
        let worth = if floor_px > 0.0 || tolerance > 0.0 { WORTH } else { 1.0 };
        let max_blur_px = (target.radius_px * factor).clamp(0.8, 4.5);
        let optics = (target.optics_of)(psf, max_blur_px)?;
        let stage = Stage {
            blur_floor_px: floor_px,
            window_tolerance: tolerance,
            ..Stage::identity(target.bin, target.pair_step)
        };
        let optics = optics.with_stage(stage);
        // With a PSF that fits badly a target may have no depth.
        let measured = target.measure(&pairs, &optics, window, tried);
        tried += 1;
        let samples = match measured {
            Err(StackError::Stopped) => return Err(StackError::Stopped),
            Err(_) => return Ok(()),
            Ok(samples) => samples,
        };
        let largest = Curve::largest_degree(samples.of.iter().filter(|s| s.original));
        for degree in DEGREES.into_iter().filter(|degree| *degree <= largest) {
            let Some((judged, inside)) = judge(&samples, degree, Split::Blocks, false) else { continue };
            // Holes count: unmeasured pixels have no error.
            let fill = inside * samples.of.len() as f64 / samples.looked_at.max(1) as f64;
            let of =
                |original: bool| robust(judged.iter().filter(|j| j.original == original).map(|j| j.error));
            // A right lens fits any texture. Noise may hide the coarser one.
            let coarser = of(false);
            let coarser = if coarser.is_finite() { coarser } else { of(true) };
            let robust = (of(true) * coarser).sqrt() * half_mm;
            // The response compensates a wrong blur, so errors hardly discriminate: prefer the measured blur.
            let unlikely = 1.0 + UNLIKELY * factor.ln().powi(2);
            let cost = unlikely * robust / fill.clamp(0.05, 1.0).powi(2);
            trials.push(Trial {
                psf: psf.to_string(),
                max_blur_px,
                blur_floor_px: floor_px,
                degree,
                robust_mm: robust,
            });
            if best.as_ref().is_none_or(|best| cost < worth * best.cost) {
                let samples = Samples { of: samples.of.clone(), ..samples };
                *best = Some(Best { cost, lens, degree, optics, samples });
            }
        }
        Ok::<(), StackError>(())
    };
    // One window finds the lens; the choice among windows follows.
    let single = Window::Fixed(LEARNED_PX[2]);
    for psf in PSFS {
        for factor in FACTORS {
            attempt(Candidate { psf, factor, floor_px: 0.0, tolerance: 0.0 }, single, &mut best)?;
        }
    }
    if let Some(lens) = best.as_ref().map(|best| best.lens) {
        for floor_px in FLOORS_PX {
            for factor in [0.85 * lens.factor, lens.factor] {
                attempt(Candidate { factor, floor_px, ..lens }, single, &mut best)?;
            }
        }
    }
    if let Some(Best { lens, .. }) = best.take() {
        // On a flat target any tolerance is good, so it is taken from the model's error there.
        let mut of_small = None;
        attempt(lens, Window::Fixed(LEARNED_PX[0]), &mut of_small)?;
        let tolerance = of_small.and_then(|small| tolerance(&small)).unwrap_or(0.0);
        attempt(lens, Window::Adaptive, &mut best)?;
        if tolerance > 0.0 {
            attempt(Candidate { tolerance, ..lens }, Window::Adaptive, &mut best)?;
        }
    }
    trials.sort_by(|a, b| a.robust_mm.total_cmp(&b.robust_mm));
    let unfit = StackError::NoPair(target.pair_step);
    let Some(Best { degree, optics, samples, .. }) = best else { return Err(unfit) };
    let samples = samples.confirmed(degree);
    let foreign = foreign::find(&samples.of, degree, target.pair_step, target.slices.len());
    let Some((stage, held_out)) = finish(&samples, degree, &optics, half_mm) else { return Err(unfit) };
    Ok(Learned { optics: optics.with_stage(stage), held_out, trials, foreign })
}

/// Difference between windows, in measured depth, that the model's error explains; `None` if noise explains most of it.
fn tolerance(small: &Best) -> Option<f64> {
    let (judged, _) = judge(&small.samples, small.degree, Split::Blocks, false)?;
    // Windows are compared before the response, which stretches depth several times for an aberrated lens.
    let measured = |j: &Judged| [j.error / j.slope, j.noise / j.slope];
    let errors: Vec<[f64; 2]> = judged.iter().filter(|j| j.original).map(measured).collect();
    let error = beyond_noise(&errors);
    let usual = median(errors.iter().map(|[_, noise]| *noise).collect(), f64::total_cmp)?;
    (error > MODEL_LIMITED * usual).then(|| (TOLERATED * error).min(LARGEST_TOLERANCE))
}

/// Standard deviation, 0 to 1, that explains errors next to that of their noise.
fn beyond_noise(errors: &[[f64; 2]]) -> f64 {
    let explains = |by: f64| {
        let squares =
            errors.iter().map(|[error, noise]| (error / noise.hypot(by)).powi(2).min(LARGEST_SQUARE));
        squares.sum::<f64>() <= errors.len() as f64
    };
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if explains(middle) { high = middle } else { low = middle }
    }
    high
}

impl Target<'_> {
    /// Where the target is between the slices of a pair, -1 at the far one to 1.
    fn place(&self, far: usize, y: usize, x: usize) -> f64 {
        -1.0 + 2.0 * (self.plane.at(y as f64, x as f64) - far as f64) / self.pair_step as f64
    }

    /// Every pair whose target lies within the range somewhere.
    fn pairs(&self) -> Result<Vec<Pair>, StackError> {
        let (height, width) = self.slices[0].dim();
        let usable = |far: &usize| {
            let corners = [(0, 0), (0, width - 1), (height - 1, 0), (height - 1, width - 1)];
            let places = corners.map(|(y, x)| self.place(*far, y, x));
            let [low, high] = places.iter().fold([f64::MAX, f64::MIN], |[a, b], v| [a.min(*v), b.max(*v)]);
            low < 1.05 && high > -1.05
        };
        let optics = (self.optics_of)(Psf::PillBox, 2.0)?;
        let settings = PrepareSettings { trust: true, coding: self.coding, ..PrepareSettings::default() };
        let pairs: Vec<Pair> = (0..self.slices.len().saturating_sub(self.pair_step))
            .filter(usable)
            .collect::<Vec<usize>>()
            .into_par_iter()
            .filter_map(|far| {
                if !(self.proceed)(0) {
                    return None;
                }
                let pair = [far, far + self.pair_step].map(|i| self.slices[i].clone());
                let prepared = prepare(pair, &optics, None, &settings).ok()?;
                // Equals a target with coarser texture, because blur and smoothing commute.
                let [far_image, near_image] =
                    [&prepared.far, &prepared.near].map(|image| binomial(image.view()));
                let noise = prepared.noise.scaled(SMOOTHED_NOISE);
                let coarse = Prepared { far: far_image, near: near_image, noise, ..prepared.clone() };
                let pair = |prepared, original| Pair {
                    far,
                    coarseness: coarseness(&prepared),
                    anisotropy: self.by_direction.map(|_| anisotropy(&prepared)),
                    prepared,
                    original,
                };
                Some([pair(prepared, true), pair(coarse, false)])
            })
            .flatten_iter()
            .collect();
        if (self.proceed)(0) { Ok(pairs) } else { Err(StackError::Stopped) }
    }

    fn measure(
        &self,
        pairs: &[Pair],
        optics: &Optics,
        window: Window,
        tried: usize,
    ) -> Result<Samples, StackError> {
        let settings = MeasureSettings {
            window,
            run: Settings { median_px: 3, ..Settings::default() },
            ..MeasureSettings::default()
        };
        let found: Vec<(Vec<Sample>, usize)> = pairs
            .par_iter()
            .map(|pair| match (self.proceed)(tried) {
                true => Ok(self.samples(pair, optics, &settings)),
                false => Err(StackError::Stopped),
            })
            .collect::<Result<_, StackError>>()?;
        let looked_at = found.iter().map(|(_, n)| n).sum();
        let of: Vec<Sample> = found.into_iter().flat_map(|(samples, _)| samples).collect();
        if of.len() < 200 {
            return Err(StackError::NoPair(self.pair_step));
        }
        let pairs = pairs.iter().filter(|pair| pair.original).count();
        Ok(Samples { of, looked_at, pairs, by_direction: self.by_direction })
    }

    fn samples(&self, pair: &Pair, optics: &Optics, settings: &MeasureSettings) -> (Vec<Sample>, usize) {
        let (height, width) = self.slices[0].dim();
        let white = Bank::whitened(optics).ok();
        let found = white
            .and_then(|white| measure(&pair.prepared, &white, optics, DepthMethod::Whitened, settings).ok());
        let (mut samples, mut looked_at) = (Vec::new(), 0);
        let places = (BORDER_PX..height.saturating_sub(BORDER_PX))
            .step_by(THIN)
            .flat_map(|y| (BORDER_PX..width.saturating_sub(BORDER_PX)).step_by(THIN).map(move |x| (y, x)));
        for (y, x) in places {
            let place = self.place(pair.far, y, x);
            if place.abs() > LEARNED {
                continue;
            }
            let truth = (self.truth_of)(optics, place);
            looked_at += 1;
            let Some((map, estimate)) = &found else { continue };
            let measured = optics.alpha(f64::from(map.depth_mm[(y, x)]));
            let slope = optics.depth_per_alpha_mm(measured).abs();
            let noise = f64::from(estimate.deviation_mm[(y, x)]) / slope;
            let usable = pair.prepared.reasons[(y, x)] == 0 && measured.is_finite() && noise < TOO_NOISY;
            if usable {
                samples.push(Sample {
                    measured,
                    truth,
                    noise,
                    misfit: estimate.misfit[(y, x)],
                    coarseness: f64::from(pair.coarseness[(y, x)]),
                    anisotropy: pair
                        .anisotropy
                        .as_ref()
                        .map_or([f64::NAN; 2], |of| of.each_ref().map(|map| f64::from(map[(y, x)]))),
                    even: (y / BLOCK_PX + x / BLOCK_PX).is_multiple_of(2),
                    left: 2 * x < width,
                    original: pair.original,
                    far: pair.far,
                });
            }
        }
        (samples, looked_at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_do_not_raise_the_error_of_the_model() {
        let errors = |outliers: usize| -> Vec<[f64; 2]> {
            (0..1000).map(|i| [if i < outliers { 0.9 } else { 0.05 }, 0.03]).collect()
        };
        for outliers in [0, 10] {
            let found = beyond_noise(&errors(outliers));
            assert!((found - 0.04).abs() < 0.003, "{outliers}: {found}");
        }
    }
}
