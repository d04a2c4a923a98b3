//! Errors on parts of the target that the response was not learned from, and the standard deviations that they demand.

use serde::{Deserialize, Serialize};

use super::ENOUGH_DEPTHS;
use super::curve::{Curve, by_direction, by_texture};
use super::response::{LEARNED, Sample, Samples, WORTH};
use crate::median::{deviation, median};
use crate::optics::{Optics, Stage, unexplained};
use crate::validity::model_error;

/// Largest error on coarser texture, relative to that of one response, of a response by texture: elsewhere the responses
/// differ by scatter.
const TEXTURE_PAYS: f64 = 0.67;
/// Fewest pairs of which some are held out.
const PAIRS_TO_SPLIT: usize = 6;
/// Least unexplained part, relative to the variance of the model's error, that is evidence of that error.
const TELLING: f64 = 0.25;
/// Least part of the errors within three standard deviations and largest RMS of error over standard deviation, of the
/// target and of the target with coarser texture.
const HONEST: [[f64; 2]; 2] = [[0.985, 1.0], [0.97, 1.3]];

/// Depths at which errors are stated, over the learned range.
const DEPTHS: usize = 15;
/// Pixels of the target that state the errors at a depth.
const FEWEST_AT_DEPTH: f64 = 30.0;

/// Errors on parts that the response was not learned from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// `1.4826 x` median of |error|, mm.
    pub robust_mm: f64,
    /// Root mean square error, mm.
    pub rms_mm: f64,
    /// Mean error, mm.
    pub bias_mm: f64,
    /// Slope of measured over true depth.
    pub slope: f64,
    /// Part of the pixels that have a depth.
    pub fill: f64,
    /// Part of the errors within three predicted standard deviations.
    pub within_three: f64,
    /// Root mean square of error over predicted standard deviation.
    pub scatter: f64,
    /// Number of pairs.
    pub pairs: usize,
    /// By depth; depths at which little of the target was seen are left out.
    pub by_depth: Vec<AtDepth>,
}

/// Errors at one depth, on parts that the response was not learned from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AtDepth {
    /// True normalised depth, -1 (far plane) to 1.
    pub depth: f64,
    /// Mean error, mm; negative: measured too near.
    pub bias_mm: f64,
    /// Root mean square error, mm.
    pub rms_mm: f64,
    /// Root mean square of the predicted standard deviations, mm.
    pub predicted_mm: f64,
}

/// How samples are split for learning and testing.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Split {
    /// A checkerboard over the field: for choices.
    Blocks,
    /// Halves of the field and every other pair: for the stated error.
    Parts,
}

pub(super) struct Judged {
    pub error: f64,
    truth: f64,
    pub noise: f64,
    /// Slope of the response, of depth over measured depth.
    pub slope: f64,
    unexplained: f32,
    pub original: bool,
}

/// Tests every sample with the response of the others, and returns the part of them that has a depth. Depths beyond the
/// response's range are not tested.
pub(super) fn judge(
    samples: &Samples,
    degree: usize,
    by: Split,
    textures: bool,
) -> Option<(Vec<Judged>, f64)> {
    let split = by == Split::Parts && samples.pairs >= PAIRS_TO_SPLIT;
    let part = |s: &Sample| match by {
        Split::Blocks => [s.even, false],
        Split::Parts => [s.left, split && s.far.is_multiple_of(2)],
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
        let astigmatism = samples.by_direction.and_then(|focus| by_direction(others(), &curve, focus));
        let stage = Stage { astigmatism, ..curve.stage(coarser) };
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
    let [shift, of_direction] = stage.shift(s.measured, s.anisotropy);
    let noise = (s.noise * slope).hypot(of_texture).hypot(of_direction);
    Some(Judged {
        error: found - shift - s.truth,
        truth: s.truth,
        original: s.original,
        noise,
        slope,
        unexplained: unexplained(s.misfit, noise as f32),
    })
}

pub(super) fn robust(errors: impl Iterator<Item = f64>) -> f64 {
    deviation(errors).unwrap_or(f64::NAN)
}

fn rms(judged: &[Judged]) -> f64 {
    (judged.iter().map(|j| j.error * j.error).sum::<f64>() / judged.len().max(1) as f64).sqrt()
}

/// The response of all samples, and the held-out errors.
pub(super) fn finish(
    samples: &Samples,
    degree: usize,
    optics: &Optics,
    half_mm: f64,
) -> Option<(Stage, HeldOut)> {
    let of = |judged: &[Judged], original: bool| {
        robust(judged.iter().filter(|j| j.original == original).map(|j| j.error))
    };
    let (plain, inside) = judge(samples, degree, Split::Parts, false)?;
    let originals = || samples.of.iter().filter(|s| s.original);
    let curve = Curve::fit(originals(), degree, None)?;
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
    let median = f64::from(median(judged.iter().map(|j| j.unexplained).collect(), f32::total_cmp)?);
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
        // Noise may hide the coarser texture everywhere.
        if n > 0.0 { [held / n, (sum / n).sqrt()] } else { [1.0, 0.0] }
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
        coarseness: usual_coarseness(samples),
        coarser,
        astigmatism: samples.by_direction.and_then(|focus| by_direction(originals(), &curve, focus)),
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
    let by_depth = by_depth(&judged, |j| predicted(j, high), half_mm);
    let held_out = HeldOut {
        robust_mm: robust(judged.iter().map(|j| j.error)) * half_mm,
        rms_mm: rms(&judged) * half_mm,
        bias_mm: -judged.iter().map(|j| j.error).sum::<f64>() / count * half_mm,
        slope: cross / square,
        fill: inside * samples.of.len() as f64 / samples.looked_at.max(1) as f64,
        within_three: within,
        scatter,
        pairs: samples.pairs,
        by_depth,
    };
    Some((stage, held_out))
}

/// The coarseness of the target, without a twentieth of its pixels at either end.
fn usual_coarseness(samples: &Samples) -> Option<[f64; 2]> {
    let of_target = samples.of.iter().filter(|s| s.original).map(|s| s.coarseness);
    let mut known: Vec<f64> = of_target.filter(|coarseness| coarseness.is_finite()).collect();
    known.sort_unstable_by(f64::total_cmp);
    let cut = known.len() / 20;
    Some([*known.get(cut)?, *known.get(known.len() - 1 - cut)?])
}

fn by_depth(judged: &[Judged], predicted: impl Fn(&Judged) -> f64, half_mm: f64) -> Vec<AtDepth> {
    let width = 2.0 * LEARNED / DEPTHS as f64;
    let mut sums = [[0.0; 4]; DEPTHS];
    for j in judged {
        let at = (((j.truth + LEARNED) / width) as usize).min(DEPTHS - 1);
        let [n, error, square, expected] = &mut sums[at];
        *n += 1.0;
        *error += j.error;
        *square += j.error * j.error;
        *expected += predicted(j).powi(2);
    }
    let enough = |(_, [n, ..]): &(usize, [f64; 4])| *n >= FEWEST_AT_DEPTH;
    let at = |(at, [n, error, square, expected]): (usize, [f64; 4])| AtDepth {
        depth: (at as f64 + 0.5) * width - LEARNED,
        // Alpha rises towards the camera, depth away from it.
        bias_mm: -error / n * half_mm,
        rms_mm: (square / n).sqrt() * half_mm,
        predicted_mm: (expected / n).sqrt() * half_mm,
    };
    sums.into_iter().enumerate().filter(enough).map(at).collect()
}
