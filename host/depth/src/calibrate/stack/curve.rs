//! The response from measured to true normalised depth. The stage gives the truth, the operators' measurement scatters:
//! so the measured depth is fitted as a polynomial of the true one, and the polynomial is inverted (classical
//! calibration). The regression of truth on measurement would pull every depth towards the few that the stack contains,
//! which is wrong for other scenes. The polynomial's slope stays near a straight line's.

use nalgebra::{DMatrix, DVector};

use super::astigmatism::FocusByDirection;
use super::response::Sample;
use crate::median::median;
use crate::optics::{Astigmatism, Coarser, RESPONSE_POINTS, Stage};

/// Extent of the response beyond the learned depths, in normalised depth.
const BEYOND: f64 = 0.05;
/// Part of the samples at either end that may be outliers.
const OUTLIERS: f64 = 0.002;
/// Measured depths at which windows saturate.
const LARGEST: f64 = 1.19;
/// Slopes relative to the straight line's.
const SLOPES: [f64; 2] = [1.0 / 3.0, 3.0];
/// Steps of the mixture of polynomial and line.
const MIXTURES: usize = 50;
/// Points at which the polynomial is inverted.
const POINTS: usize = 200;
/// Degree of coarseness and anisotropy over measured depth: of both sides of focus, the more blurred is coarser.
const TEXTURE_DEGREE: usize = 2;
/// Least difference of two textures' coarseness.
const LEAST_APART: f64 = 0.1;
/// Width of a class of true depths, for [`Curve::largest_degree`].
const CLASS: f64 = 0.1;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curve {
    /// Least and largest measured depth.
    pub measured: [f64; 2],
    /// True depth at evenly spaced measured ones.
    pub response: [f64; RESPONSE_POINTS],
}

impl Curve {
    /// Degree that the true depths of a stack determine: one less than its separate depths, or one per half unit.
    pub fn largest_degree<'a>(samples: impl Iterator<Item = &'a Sample> + Clone) -> usize {
        let class = |s: &Sample| ((s.truth + 2.0) / CLASS).clamp(0.0, 4.0 / CLASS) as usize;
        let mut counts = vec![0_usize; (4.0 / CLASS) as usize + 1];
        samples.clone().for_each(|s| counts[class(s)] += 1);
        let least = 1 + samples.count() / 200;
        let occupied: Vec<bool> = counts.iter().map(|count| *count >= least).collect();
        let runs = occupied.windows(2).filter(|pair| pair[1] && !pair[0]).count();
        let covered = CLASS * occupied.iter().filter(|occupied| **occupied).count() as f64;
        runs.saturating_sub(1).max((2.0 * covered) as usize).max(1)
    }

    /// `None` for too few samples, and for values that do not rise with the truth. `over` is the range of measured depths;
    /// by default that of the samples.
    pub fn fit<'a>(
        samples: impl Iterator<Item = &'a Sample> + Clone,
        degree: usize,
        over: Option<[f64; 2]>,
    ) -> Option<Self> {
        let sorted = |value: fn(&Sample) -> f64| {
            let mut values: Vec<f64> = samples.clone().map(value).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let (places, truths) = (sorted(|s| s.measured), sorted(|s| s.truth));
        if places.len() < 50 {
            return None;
        }
        let quantile = |of: &[f64], q: f64| of[((of.len() - 1) as f64 * q) as usize];
        let [low, high] = over.unwrap_or([
            (quantile(&places, OUTLIERS) - BEYOND).max(-LARGEST),
            (quantile(&places, 1.0 - OUTLIERS) + BEYOND).min(LARGEST),
        ]);
        let [first, last] = [OUTLIERS, 1.0 - OUTLIERS].map(|q| quantile(&truths, q));
        let points = samples.map(|s| [s.truth, s.measured]);
        let line = polynomial(points.clone(), 1)?;
        let c = polynomial(points, degree)?;
        if line[1] <= 0.05 || low >= high || first >= last {
            return None;
        }
        let truth = |i: usize| first + (last - first) * i as f64 / (POINTS - 1) as f64;
        // The largest part of the polynomial that keeps the slopes.
        let measured = (0..=MIXTURES).rev().map(|part| part as f64 / MIXTURES as f64).find_map(|part| {
            let at = |t: f64| part * value(&c, t) + (1.0 - part) * value(&line, t);
            let measured: Vec<f64> = (0..POINTS).map(|i| at(truth(i))).collect();
            let least = line[1] * (truth(1) - truth(0));
            let kept = measured
                .windows(2)
                .all(|pair| (SLOPES[0] - 1e-9..=SLOPES[1] + 1e-9).contains(&((pair[1] - pair[0]) / least)));
            kept.then_some(measured)
        })?;
        let inverse = |m: f64| {
            let after = measured.partition_point(|v| *v < m);
            // Beyond the learned depths, where only scatter leads, along the line.
            let beyond = |i: usize| truth(i) + (m - measured[i]) / line[1];
            match after {
                0 => beyond(0),
                POINTS => beyond(POINTS - 1),
                _ => {
                    let [a, b] = [measured[after - 1], measured[after]];
                    truth(after - 1) + (truth(after) - truth(after - 1)) * (m - a) / (b - a)
                }
            }
        };
        let unit = (high - low) / (RESPONSE_POINTS - 1) as f64;
        let response = std::array::from_fn(|i| inverse(low + unit * i as f64).clamp(-1.5, 1.5));
        Some(Self { measured: [low, high], response })
    }

    pub fn stage(&self, coarser: Option<Coarser>) -> Stage {
        Stage { measured: self.measured, response: self.response, coarser, ..Stage::identity(1, 1) }
    }
}

/// Responses to the target and to the coarser target, if their textures differ enough.
pub(super) fn by_texture<'a>(
    samples: impl Iterator<Item = &'a Sample> + Clone,
    degree: usize,
    curve: &Curve,
) -> Option<Coarser> {
    let of = |original: bool| samples.clone().filter(move |s| s.original == original);
    let coarse = Curve::fit(of(false), degree, Some(curve.measured))?;
    let table = |original: bool| table(of(original).map(|s| [s.measured, s.coarseness]), curve);
    let [of_target, coarseness] = [table(true)?, table(false)?];
    let apart = of_target.iter().zip(&coarseness).all(|(fine, coarse)| coarse - fine > LEAST_APART);
    apart.then_some(Coarser { response: coarse.response, of_target, coarseness })
}

/// What a focus that depends on direction adds to depth. Blur that is not round gives round texture a direction, which
/// the response contains.
pub(super) fn by_direction<'a>(
    samples: impl Iterator<Item = &'a Sample> + Clone,
    curve: &Curve,
    focus: FocusByDirection,
) -> Option<Astigmatism> {
    let table =
        |component: usize| table(samples.clone().map(move |s| [s.measured, s.anisotropy[component]]), curve);
    let FocusByDirection { shift_per_anisotropy, spread } = focus;
    Some(Astigmatism { shift_per_anisotropy, spread, of_target: [table(0)?, table(1)?] })
}

/// Values of texture `[measured depth, value]` at the response's measured depths.
fn table(texture: impl Iterator<Item = [f64; 2]> + Clone, curve: &Curve) -> Option<[f64; RESPONSE_POINTS]> {
    let c = polynomial(texture.filter(|[_, value]| value.is_finite()), TEXTURE_DEGREE)?;
    let [low, high] = curve.measured;
    let at = |i: usize| low + (high - low) * i as f64 / (RESPONSE_POINTS - 1) as f64;
    Some(std::array::from_fn(|i| value(&c, at(i))))
}

/// Coefficients of the polynomial through points `[x, y]`, by least squares with Huber's weights.
fn polynomial(points: impl Iterator<Item = [f64; 2]> + Clone, degree: usize) -> Option<Vec<f64>> {
    let n = degree + 1;
    let mut found: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == 1))).collect();
    let mut limit = f64::INFINITY;
    for _ in 0..6 {
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        let mut sizes = Vec::new();
        for [x, y] in points.clone() {
            let error = y - value(&found, x);
            sizes.push(error.abs());
            let weight = if error.abs() > limit { limit / error.abs() } else { 1.0 };
            let powers: Vec<f64> = (0..n).map(|k| x.powi(k as i32)).collect();
            for i in 0..n {
                right[i] += weight * powers[i] * y;
                for j in 0..n {
                    normal[(i, j)] += weight * powers[i] * powers[j];
                }
            }
        }
        // Keeps what few depths leave undetermined straight.
        for i in 0..n {
            normal[(i, i)] += if i > 1 { 1e-4 } else { 1e-9 } * sizes.len() as f64;
        }
        found = normal.lu().solve(&right)?.iter().copied().collect();
        limit = (1.5 * 1.4826 * median(sizes, f64::total_cmp)?).max(1e-4);
    }
    Some(found)
}

fn value(c: &[f64], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(curve: &Curve, measured: f64) -> Option<[f64; 3]> {
        curve.stage(None).respond(measured, f64::NAN)
    }

    fn samples(measured_of: impl Fn(f64) -> f64, truths: impl Iterator<Item = f64>) -> Vec<Sample> {
        truths.map(|truth| Sample::exact(measured_of(truth), truth)).collect()
    }

    #[test]
    fn a_bent_response_is_learned_and_ends_where_the_samples_do() {
        let bent = |t: f64| 0.1 + 0.8 * t + 0.15 * t.powi(3);
        let learned = samples(bent, (0..400).map(|i| -0.9 + 1.8 * f64::from(i) / 399.0));
        let curve = Curve::fit(learned.iter(), 5, None).unwrap();
        for truth in [-0.85, -0.3, 0.0, 0.5, 0.88] {
            let [found, slope, _] = at(&curve, bent(truth)).unwrap();
            assert!((found - truth).abs() < 0.01, "{truth} {found}");
            let expected = 1.0 / (0.8 + 0.45 * truth * truth);
            assert!((slope - expected).abs() < 0.15 * expected, "{truth} {slope} {expected}");
        }
        assert!(at(&curve, bent(1.05)).is_none(), "no depth beyond the learned range");
        let falling = samples(|t| -t, (0..400).map(|i| -1.0 + f64::from(i) / 200.0));
        assert_eq!(Curve::fit(falling.iter(), 3, None), None);
    }

    /// Two depths with noise: the best prediction of these two is flat at either and useless for other scenes.
    #[test]
    fn two_known_depths_make_no_plateaus() {
        let learned: Vec<Sample> = (0..2000)
            .map(|i| {
                let truth = if i % 2 == 0 { -0.5 } else { 0.5 };
                Sample::exact(truth + 0.3 * ((i as f64 * 0.618).fract() - 0.5), truth)
            })
            .collect();
        assert_eq!(Curve::largest_degree(learned.iter()), 1);
        let curve = Curve::fit(learned.iter(), 1, None).unwrap();
        for measured in [-0.6, -0.1, 0.3, 0.62] {
            let [found, slope, _] = at(&curve, measured).unwrap();
            assert!(
                (found - measured).abs() < 0.02 && (slope - 1.0).abs() < 0.05,
                "{measured} {found} {slope}"
            );
        }
    }
}
