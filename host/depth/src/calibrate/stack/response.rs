//! The response from measured to true normalised depth, learned on half of the blocks of a checkerboard and judged on the rest.

use nalgebra::{DMatrix, DVector};
use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::focus_plane::FocusPlane;
use super::{HeldOut, StackError};
use crate::adaptive_window::Window;
use crate::measure::{DepthMethod, MeasureSettings, measure_pair};
use crate::optics::{Optics, RESPONSE_POINTS, Stage};
use crate::pipeline::Settings;
use crate::psf::Psf;

/// Side of a block, px: larger than what windows see.
const BLOCK_PX: usize = 48;
/// Border that takes no part, px.
const BORDER_PX: usize = 12;
/// One of so many pixels is used.
const THIN: usize = 5;
/// True normalised depths that are learned; a little beyond the range.
const LEARNED: f64 = 1.12;
/// Degrees of the polynomial.
const DEGREES: [usize; 3] = [1, 3, 5];
/// Blur radii relative to the measured one.
const FACTORS: [f64; 5] = [0.7, 0.85, 1.0, 1.2, 1.4];

/// One combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// PSF by name.
    pub psf: String,
    /// Largest blur radius, px.
    pub max_blur_px: f64,
    /// Degree of the response.
    pub degree: usize,
    /// Robust error on the held-out blocks, mm.
    pub robust_mm: f64,
}

/// A pixel of a pair.
#[derive(Clone, Copy)]
struct Sample {
    measured: f64,
    truth: f64,
    /// Standard deviation of `measured` by noise.
    noise: f64,
    even: bool,
}

struct Samples {
    of: Vec<Sample>,
    looked_at: usize,
    pairs: usize,
}

type Learned = (Optics, HeldOut, Vec<Trial>);

pub(super) fn learn(
    slices: &[Array2<f32>],
    plane: &FocusPlane,
    pair_step: usize,
    bin: usize,
    radius_px: f64,
    step_mm: f64,
    optics_of: &(dyn Fn(Psf, f64) -> Result<Optics, StackError> + Sync),
) -> Result<Learned, StackError> {
    let half_mm = 0.5 * step_mm * pair_step as f64;
    let psfs = [Psf::PillBox, Psf::Gaussian { k: 0.5 }, Psf::Generalised { p: 3.0, k: 0.62 }];
    let mut best: Option<(f64, usize, Optics, Samples)> = None;
    let mut trials = Vec::new();
    for psf in psfs {
        for factor in FACTORS {
            let max_blur_px = (radius_px * factor).clamp(0.8, 4.5);
            let optics = optics_of(psf, max_blur_px)?;
            let samples = measure(slices, plane, pair_step, &optics)?;
            for degree in DEGREES {
                let Some(errors) = held_out_errors(&samples, degree) else { continue };
                // Holes count: what is not measured has no error.
                let fill = samples.of.len() as f64 / samples.looked_at.max(1) as f64;
                let robust = robust(&errors) * half_mm;
                let cost = robust / fill.clamp(0.05, 1.0).powi(2);
                trials.push(Trial { psf: psf.to_string(), max_blur_px, degree, robust_mm: robust });
                if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                    let copy = Samples { of: samples.of.clone(), ..samples };
                    best = Some((cost, degree, optics, copy));
                }
            }
        }
    }
    trials.sort_by(|a, b| a.robust_mm.total_cmp(&b.robust_mm));
    let Some((_, degree, optics, samples)) = best else { return Err(StackError::NoPair(pair_step)) };
    let (stage, held_out) = finish(&samples, degree, bin, pair_step, half_mm);
    Ok((optics.with_stage(stage), held_out, trials))
}

/// Measures every pair whose target lies within the range somewhere.
fn measure(
    slices: &[Array2<f32>],
    plane: &FocusPlane,
    step: usize,
    optics: &Optics,
) -> Result<Samples, StackError> {
    let (height, width) = slices[0].dim();
    let identity = optics.with_stage(Stage::identity(1, step));
    let settings = MeasureSettings {
        window: Window::Adaptive,
        run: Settings { median_px: 3, ..Settings::default() },
        ..MeasureSettings::default()
    };
    let alpha =
        |i: usize, y: usize, x: usize| -1.0 + 2.0 * (plane.at(y as f64, x as f64) - i as f64) / step as f64;
    let usable: Vec<usize> = (0..slices.len().saturating_sub(step))
        .filter(|i| alpha(*i, height / 2, width / 2).abs() < 1.0 + 0.3)
        .collect();
    let found: Vec<(Vec<Sample>, usize)> = usable
        .par_iter()
        .map(|&i| {
            let pair = [slices[i].clone(), slices[i + step].clone()];
            let found = measure_pair(pair, &identity, DepthMethod::Whitened, None, &settings).ok();
            let (mut samples, mut looked_at) = (Vec::new(), 0);
            for y in (BORDER_PX..height.saturating_sub(BORDER_PX)).step_by(THIN) {
                for x in (BORDER_PX..width.saturating_sub(BORDER_PX)).step_by(THIN) {
                    let truth = alpha(i, y, x);
                    if truth.abs() > LEARNED {
                        continue;
                    }
                    looked_at += 1;
                    let Some(found) = &found else { continue };
                    let depth = f64::from(found.map.depth_mm[(y, x)]);
                    if depth.is_finite() {
                        let measured = optics.alpha(depth);
                        let slope = optics.depth_per_alpha_mm(measured).abs();
                        samples.push(Sample {
                            measured,
                            truth,
                            noise: f64::from(found.validity.deviation_mm[(y, x)]) / slope,
                            even: (y / BLOCK_PX + x / BLOCK_PX).is_multiple_of(2),
                        });
                    }
                }
            }
            (samples, looked_at)
        })
        .collect();
    let looked_at = found.iter().map(|(_, n)| n).sum();
    let of: Vec<Sample> = found.into_iter().flat_map(|(samples, _)| samples).collect();
    if of.len() < 200 {
        return Err(StackError::NoPair(step));
    }
    Ok(Samples { of, looked_at, pairs: usable.len() })
}

/// Coefficients of the polynomial from measured to true, by least squares with Huber's weights; `None` where it falls.
fn polynomial<'a>(samples: impl Iterator<Item = &'a Sample> + Clone, degree: usize) -> Option<Vec<f64>> {
    let n = degree + 1;
    let mut found: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == 1))).collect();
    let mut limit = f64::INFINITY;
    for _ in 0..6 {
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        let mut sizes = Vec::new();
        for s in samples.clone() {
            let error = s.truth - value(&found, s.measured);
            sizes.push(error.abs());
            let weight = if error.abs() > limit { limit / error.abs() } else { 1.0 };
            let powers: Vec<f64> = (0..n).map(|k| s.measured.powi(k as i32)).collect();
            for i in 0..n {
                right[i] += weight * powers[i] * s.truth;
                for j in 0..n {
                    normal[(i, j)] += weight * powers[i] * powers[j];
                }
            }
        }
        for i in 0..n {
            normal[(i, i)] += 1e-9 * sizes.len() as f64;
        }
        found = normal.lu().solve(&right)?.iter().copied().collect();
        let middle = sizes.len() / 2;
        limit = 1.5 * 1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        limit = limit.max(1e-4);
    }
    Some(found)
}

fn value(c: &[f64], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

fn held_out_errors(samples: &Samples, degree: usize) -> Option<Vec<f64>> {
    let mut errors = Vec::with_capacity(samples.of.len());
    for even in [true, false] {
        let c = polynomial(samples.of.iter().filter(|s| s.even == even), degree)?;
        errors.extend(samples.of.iter().filter(|s| s.even != even).map(|s| value(&c, s.measured) - s.truth));
    }
    Some(errors)
}

fn robust(errors: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
    let middle = sizes.len() / 2;
    1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The response of all samples, and what the held-out ones say of it.
fn finish(samples: &Samples, degree: usize, bin: usize, step: usize, half_mm: f64) -> (Stage, HeldOut) {
    let mut measured: Vec<f64> = samples.of.iter().map(|s| s.measured).collect();
    measured.sort_by(f64::total_cmp);
    let quantile = |q: f64| measured[((measured.len() - 1) as f64 * q) as usize];
    let range = [(quantile(0.001) - 0.05).max(-1.19), (quantile(0.999) + 0.05).min(1.19)];
    let all = polynomial(samples.of.iter(), degree).unwrap_or_else(|| vec![0.0, 1.0]);
    let mut response: [f64; RESPONSE_POINTS] = std::array::from_fn(|i| {
        let at = range[0] + (range[1] - range[0]) * i as f64 / (RESPONSE_POINTS - 1) as f64;
        value(&all, at).clamp(-1.3, 1.3)
    });
    // Rising outwards from the middle.
    let middle = RESPONSE_POINTS / 2;
    for i in middle + 1..RESPONSE_POINTS {
        response[i] = response[i].max(response[i - 1] + 1e-6);
    }
    for i in (0..middle).rev() {
        response[i] = response[i].min(response[i + 1] - 1e-6);
    }
    let mut stage =
        Stage { bin, pair_step: step, measured: range, response, residual: 0.0, usual_misfit: 1e6 };
    let errors = held_out_errors(samples, degree).unwrap_or_default();
    let noise: Vec<f64> = [true, false]
        .iter()
        .flat_map(|even| samples.of.iter().filter(move |s| s.even != *even))
        .map(|s| s.noise * stage.respond(s.measured).map_or(1.0, |[_, slope]| slope))
        .collect();
    let within = |residual: f64| {
        let inside = errors.iter().zip(&noise).filter(|(e, n)| e.abs() <= 3.0 * n.hypot(residual)).count();
        inside as f64 / errors.len().max(1) as f64
    };
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..30 {
        let try_it = 0.5 * (low + high);
        if within(try_it) < 0.99 { low = try_it } else { high = try_it }
    }
    stage.residual = high;
    let count = errors.len().max(1) as f64;
    let truths: Vec<f64> = [true, false]
        .iter()
        .flat_map(|even| samples.of.iter().filter(move |s| s.even != *even))
        .map(|s| s.truth)
        .collect();
    let mean = truths.iter().sum::<f64>() / count;
    let [cross, square] = truths
        .iter()
        .zip(&errors)
        .fold([0.0; 2], |[a, b], (t, e)| [a + (t - mean) * (t + e), b + (t - mean) * (t - mean)]);
    let held_out = HeldOut {
        robust_mm: robust(&errors) * half_mm,
        rms_mm: (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt() * half_mm,
        bias_mm: -errors.iter().sum::<f64>() / count * half_mm,
        slope: cross / square,
        fill: samples.of.len() as f64 / samples.looked_at.max(1) as f64,
        within_three: within(stage.residual),
        pairs: samples.pairs,
    };
    (stage, held_out)
}
