//! Which PSF, blur and response fit the target, learned on one part of it and tested on the rest. A checkerboard of
//! blocks decides the choices. The stated error is stricter: half of the field in every other pair is tested with the
//! response of the other half in the other pairs, at other places and distances. The target is tested again with
//! coarser texture, on which no choice may depend.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use ndarray::Array2;

use super::curve::{Curve, by_texture};
use super::focus_plane::{FocusPlane, blurred};
use super::{ENOUGH_DEPTHS, HeldOut, StackError};
use crate::adaptive_window::{Bank, LEARNED_PX, Window};
use crate::coarseness::coarseness;
use crate::measure::{DepthMethod, MeasureSettings, measure};
use crate::optics::{Optics, Stage, unexplained};
use crate::pipeline::Settings;
use crate::prepare::{PrepareSettings, Prepared, prepare_owned};
use crate::psf::Psf;
use crate::validity::model_error;

/// Side of a checkerboard block, px: larger than the windows' reach.
const BLOCK_PX: usize = 48;
/// Ignored border, px.
const BORDER_PX: usize = 12;
/// One of this many pixels is used, along both axes.
const THIN: usize = 5;
/// True normalised depths that are learned; a little beyond the range.
const LEARNED: f64 = 1.12;
/// Standard deviation of normalised depth by noise beyond which a pixel has no depth.
const TOO_NOISY: f64 = 0.12;
const DEGREES: [usize; 4] = [1, 2, 3, 5];
/// Blur radii relative to the measured one.
const FACTORS: [f64; 5] = [0.7, 0.85, 1.0, 1.2, 1.4];
/// Penalty of a blur that differs from the measured one, per squared logarithm of their ratio.
const UNLIKELY: f64 = 0.5;
/// Least blur radii that are tried with the best PSF, px.
const FLOORS_PX: [f64; 3] = [0.5, 0.9, 1.3];
/// Differences between windows that are tried with the best lens.
const TOLERANCES: [f64; 4] = [0.0, 0.03, 0.07, 0.15];
/// Improvement that justifies a lens with one more parameter.
const WORTH: f64 = 0.97;
/// Largest error on coarser texture, relative to that of one response, of a response by texture: elsewhere the responses
/// differ by scatter.
const TEXTURE_PAYS: f64 = 0.67;
/// Fewest pairs of which some are held out.
const PAIRS_TO_SPLIT: usize = 6;
/// Part of the noise's variance that smoothing leaves: sum of the squared taps.
const SMOOTHED_NOISE: f64 = 0.0748;
/// Least unexplained part, relative to the variance of the model's error, that is evidence of that error.
const TELLING: f64 = 0.25;
/// Least part of the errors within three standard deviations and largest RMS of error over standard deviation, of the
/// target and of the target with coarser texture.
const HONEST: [[f64; 2]; 2] = [[0.985, 1.0], [0.97, 1.3]];

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
    noise: f64,
    /// Mean square residual relative to the noise.
    misfit: f32,
    pub coarseness: f64,
    /// Colour of its block on a checkerboard.
    even: bool,
    /// Half of the field, and every other pair.
    part: [bool; 2],
    /// Original target, not smoothed.
    pub original: bool,
}

/// How samples are split for learning and testing.
#[derive(Clone, Copy, PartialEq)]
enum Split {
    /// A checkerboard over the field: for choices.
    Blocks,
    /// Halves of the field and every other pair: for the stated error.
    Parts,
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
            even: false,
            part: [false; 2],
            original: true,
        }
    }
}

struct Judged {
    error: f64,
    truth: f64,
    noise: f64,
    unexplained: f32,
    original: bool,
}

struct Samples {
    of: Vec<Sample>,
    looked_at: usize,
    pairs: usize,
}

struct Pair {
    far: usize,
    prepared: Prepared,
    coarseness: Array2<f32>,
    original: bool,
}

type Learned = (Optics, HeldOut, Vec<Trial>);

/// Slices to calibrate, binned.
pub(super) struct Target<'a> {
    pub slices: &'a [Array2<f32>],
    pub plane: &'a FocusPlane,
    pub pair_step: usize,
    pub bin: usize,
    /// Largest blur radius as measured, px.
    pub radius_px: f64,
    pub step_mm: f64,
    pub optics_of: &'a (dyn Fn(Psf, f64) -> Result<Optics, StackError> + Sync),
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
    let half_mm = 0.5 * target.step_mm * target.pair_step as f64;
    let psfs = [
        Psf::PillBox,
        Psf::Generalised { p: 3.0, k: 0.62 },
        Psf::Gaussian { k: 0.5 },
        Psf::Generalised { p: 1.5, k: 0.42 },
    ];
    let mut best: Option<Best> = None;
    let mut trials = Vec::new();
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
        let Ok(samples) = target.measure(&pairs, &optics, window) else { return Ok(()) };
        let largest = Curve::largest_degree(samples.of.iter().filter(|s| s.original));
        for degree in DEGREES.into_iter().filter(|degree| *degree <= largest) {
            let Some((judged, inside)) = judge(&samples, degree, Split::Blocks, false) else { continue };
            // Holes count: unmeasured pixels have no error.
            let fill = inside * samples.of.len() as f64 / samples.looked_at.max(1) as f64;
            let of =
                |original: bool| robust(judged.iter().filter(|j| j.original == original).map(|j| j.error));
            // A right lens fits any texture.
            let robust = (of(true) * of(false)).sqrt() * half_mm;
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
    for psf in psfs {
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
        for tolerance in TOLERANCES {
            attempt(Candidate { tolerance, ..lens }, Window::Adaptive, &mut best)?;
        }
    }
    trials.sort_by(|a, b| a.robust_mm.total_cmp(&b.robust_mm));
    let unfit = StackError::NoPair(target.pair_step);
    let Some(Best { degree, optics, samples, .. }) = best else { return Err(unfit) };
    let Some((stage, held_out)) = finish(&samples, degree, &optics, half_mm) else { return Err(unfit) };
    Ok((optics.with_stage(stage), held_out, trials))
}

impl Target<'_> {
    fn alpha(&self, far: usize, y: usize, x: usize) -> f64 {
        -1.0 + 2.0 * (self.plane.at(y as f64, x as f64) - far as f64) / self.pair_step as f64
    }

    /// Every pair whose target lies within the range somewhere.
    fn pairs(&self) -> Result<Vec<Pair>, StackError> {
        let (height, width) = self.slices[0].dim();
        let usable = |far: &usize| {
            let corners = [(0, 0), (0, width - 1), (height - 1, 0), (height - 1, width - 1)];
            let alphas = corners.map(|(y, x)| self.alpha(*far, y, x));
            let [low, high] = alphas.iter().fold([f64::MAX, f64::MIN], |[a, b], v| [a.min(*v), b.max(*v)]);
            low < 1.05 && high > -1.05
        };
        let optics = (self.optics_of)(Psf::PillBox, 2.0)?;
        let settings = PrepareSettings { trust: true, ..PrepareSettings::default() };
        Ok((0..self.slices.len().saturating_sub(self.pair_step))
            .filter(usable)
            .collect::<Vec<usize>>()
            .into_par_iter()
            .filter_map(|far| {
                let pair = [far, far + self.pair_step].map(|i| self.slices[i].clone());
                let prepared = prepare_owned(pair, &optics, None, &settings).ok()?;
                // Equals a target with coarser texture, because blur and smoothing commute.
                let [far_image, near_image] = [&prepared.far, &prepared.near].map(blurred);
                let mut coarse = Prepared { far: far_image, near: near_image, ..prepared.clone() };
                let noise = &mut coarse.noise;
                for value in [&mut noise.constant, &mut noise.per_unit, &mut noise.mean_variance] {
                    *value *= SMOOTHED_NOISE;
                }
                let pair =
                    |prepared, original| Pair { far, coarseness: coarseness(&prepared), prepared, original };
                Some([pair(prepared, true), pair(coarse, false)])
            })
            .flatten_iter()
            .collect())
    }

    fn measure(&self, pairs: &[Pair], optics: &Optics, window: Window) -> Result<Samples, StackError> {
        let settings = MeasureSettings {
            window,
            run: Settings { median_px: 3, ..Settings::default() },
            ..MeasureSettings::default()
        };
        let found: Vec<(Vec<Sample>, usize)> =
            pairs.par_iter().map(|pair| self.samples(pair, optics, &settings)).collect();
        let looked_at = found.iter().map(|(_, n)| n).sum();
        let of: Vec<Sample> = found.into_iter().flat_map(|(samples, _)| samples).collect();
        if of.len() < 200 {
            return Err(StackError::NoPair(self.pair_step));
        }
        Ok(Samples { of, looked_at, pairs: pairs.iter().filter(|pair| pair.original).count() })
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
            let truth = self.alpha(pair.far, y, x);
            if truth.abs() > LEARNED {
                continue;
            }
            looked_at += 1;
            let Some((map, estimate)) = &found else { continue };
            let measured = optics.alpha(f64::from(map.depth_mm[(y, x)]));
            let slope = optics.depth_per_alpha_mm(0.0).abs();
            let noise = f64::from(estimate.deviation_mm[(y, x)]) / slope;
            let usable = pair.prepared.reasons[(y, x)] == 0 && measured.is_finite() && noise < TOO_NOISY;
            if usable {
                samples.push(Sample {
                    measured,
                    truth,
                    noise,
                    misfit: estimate.misfit[(y, x)],
                    coarseness: f64::from(pair.coarseness[(y, x)]),
                    even: (y / BLOCK_PX + x / BLOCK_PX).is_multiple_of(2),
                    part: [2 * x < width, pair.far.is_multiple_of(2)],
                    original: pair.original,
                });
            }
        }
        (samples, looked_at)
    }
}

/// Tests every sample with the response of the others, and returns the part of them that has a depth. Depths beyond the
/// response's range are not tested.
fn judge(samples: &Samples, degree: usize, by: Split, textures: bool) -> Option<(Vec<Judged>, f64)> {
    let split = by == Split::Parts && samples.pairs >= PAIRS_TO_SPLIT;
    let part = |s: &Sample| match by {
        Split::Blocks => [s.even, false],
        Split::Parts => [s.part[0], split && s.part[1]],
    };
    let parts: Vec<[bool; 2]> = samples.of.iter().map(part).collect();
    let mut judged = Vec::with_capacity(samples.of.len());
    let mut eligible = 0_usize;
    for part in [[false, false], [true, false], [false, true], [true, true]] {
        let all = || {
            let other = |of: &[bool; 2]| of[0] != part[0] && (!split || of[1] != part[1]);
            samples.of.iter().zip(&parts).filter(move |(_, of)| other(of)).map(|(s, _)| s)
        };
        let others = || all().filter(|s| s.original);
        let own: Vec<&Sample> =
            samples.of.iter().zip(&parts).filter(|(_, of)| **of == part).map(|(s, _)| s).collect();
        if own.is_empty() {
            continue;
        }
        let degree = degree.min(Curve::largest_degree(others()));
        let curve = Curve::fit(others(), degree, None)?;
        let coarser = if textures { Some(by_texture(all(), degree, &curve)?) } else { None };
        let stage = curve.stage(coarser);
        let [low, high] =
            others().fold([f64::MAX, f64::MIN], |[low, high], s| [low.min(s.truth), high.max(s.truth)]);
        for s in own.into_iter().filter(|s| (low..=high).contains(&s.truth)) {
            eligible += 1;
            judged.extend(tested(&stage, s));
        }
    }
    let inside = judged.len() as f64 / eligible.max(1) as f64;
    (judged.len() > 100).then_some((judged, inside))
}

fn tested(stage: &Stage, s: &Sample) -> Option<Judged> {
    let [found, slope, of_texture] = stage.respond(s.measured, s.coarseness)?;
    let noise = (s.noise * slope).hypot(of_texture);
    Some(Judged {
        error: found - s.truth,
        truth: s.truth,
        original: s.original,
        noise,
        unexplained: unexplained(s.misfit, noise as f32),
    })
}

fn robust(errors: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = errors.map(f64::abs).collect();
    if sizes.is_empty() {
        return f64::NAN;
    }
    let middle = sizes.len() / 2;
    1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn rms(judged: &[Judged]) -> f64 {
    (judged.iter().map(|j| j.error * j.error).sum::<f64>() / judged.len().max(1) as f64).sqrt()
}

/// The response of all samples, and the held-out errors.
fn finish(samples: &Samples, degree: usize, optics: &Optics, half_mm: f64) -> Option<(Stage, HeldOut)> {
    let of = |judged: &[Judged], original: bool| {
        robust(judged.iter().filter(|j| j.original == original).map(|j| j.error))
    };
    let (plain, inside) = judge(samples, degree, Split::Parts, false)?;
    let curve = Curve::fit(samples.of.iter().filter(|s| s.original), degree, None)?;
    // Few pairs do not determine the difference of two responses; the deviation has to cover it.
    let enough = samples.pairs >= ENOUGH_DEPTHS;
    let coarser = if enough { by_texture(samples.of.iter(), degree, &curve) } else { None };
    let by_texture = coarser.and_then(|coarser| {
        let (judged, inside) = judge(samples, degree, Split::Parts, true)?;
        let pays = of(&judged, false) <= TEXTURE_PAYS * of(&plain, false)
            && of(&judged, true) <= of(&plain, true) / WORTH;
        pays.then_some((judged, inside, coarser))
    });
    let (judged, inside, coarser) = match by_texture {
        Some((judged, inside, coarser)) => (judged, inside, Some(coarser)),
        None => (plain, inside, None),
    };
    let mut left: Vec<f32> = judged.iter().map(|j| j.unexplained).collect();
    let middle = left.len() / 2;
    let median = f64::from(*left.select_nth_unstable_by(middle, f32::total_cmp).1);
    // Values below the model's error carry no information about it.
    let usual = |residual: f64| median.max(TELLING * residual * residual).max(1e-9);
    let predicted = |j: &Judged, residual: f64| {
        let ratio = j.unexplained / usual(residual) as f32;
        j.noise.hypot(f64::from(model_error(residual as f32, ratio)))
    };
    // Part within three deviations, and RMS of error over deviation.
    let honesty = |original: bool, residual: f64| {
        let relative = judged
            .iter()
            .filter(|j| j.original == original)
            .map(|j| (j.error / predicted(j, residual)).powi(2))
            .fold([0.0; 3], |[n, held, sum], square| {
                [n + 1.0, held + f64::from(u8::from(square <= 9.0)), sum + square]
            });
        let [n, held, sum] = relative;
        [held / f64::max(n, 1.0), (sum / f64::max(n, 1.0)).sqrt()]
    };
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        let holds = [true, false].iter().zip(HONEST).all(|(original, [least, most])| {
            let [within, scatter] = honesty(*original, middle);
            within >= least && scatter <= most
        });
        if holds { high = middle } else { low = middle }
    }
    let identity = optics.stage()?;
    let stage = Stage {
        measured: curve.measured,
        response: curve.response,
        residual: high,
        usual_unexplained: usual(high),
        coarser,
        ..*identity
    };
    let [within, scatter] = honesty(true, high);
    let judged: Vec<Judged> = judged.into_iter().filter(|j| j.original).collect();
    let count = judged.len() as f64;
    let mean = judged.iter().map(|j| j.truth).sum::<f64>() / count;
    let [cross, square] = judged.iter().fold([0.0; 2], |[a, b], j| {
        let away = j.truth - mean;
        [a + away * (j.truth + j.error), b + away * away]
    });
    let held_out = HeldOut {
        robust_mm: robust(judged.iter().map(|j| j.error)) * half_mm,
        rms_mm: rms(&judged) * half_mm,
        bias_mm: -judged.iter().map(|j| j.error).sum::<f64>() / count * half_mm,
        slope: cross / square,
        fill: inside * samples.of.len() as f64 / samples.looked_at.max(1) as f64,
        within_three: within,
        scatter,
        pairs: samples.pairs,
    };
    Some((stage, held_out))
}
