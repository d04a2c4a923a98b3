//! The response from measured to true normalised depth: a polynomial whose slope stays near a straight line's. A stack
//! has few depths when its pairs are close together. A free polynomial would pull every measured depth towards these,
//! which is wrong for other scenes.

use nalgebra::{DMatrix, DVector};

use super::response::Sample;
use crate::optics::{RESPONSE_POINTS, interpolated};

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

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curve {
    /// Least and largest measured depth.
    pub measured: [f64; 2],
    /// True depth at evenly spaced measured ones.
    pub response: [f64; RESPONSE_POINTS],
}

impl Curve {
    /// `None` for too few samples, and for values that do not rise with the truth.
    pub fn fit<'a>(samples: impl Iterator<Item = &'a Sample> + Clone, degree: usize) -> Option<Self> {
        let mut places: Vec<f64> = samples.clone().map(|s| s.measured).collect();
        if places.len() < 50 {
            return None;
        }
        places.sort_by(f64::total_cmp);
        let quantile = |q: f64| places[((places.len() - 1) as f64 * q) as usize];
        let low = (quantile(OUTLIERS) - BEYOND).max(-LARGEST);
        let high = (quantile(1.0 - OUTLIERS) + BEYOND).min(LARGEST);
        let line = polynomial(samples.clone(), 1)?;
        let c = polynomial(samples, degree)?;
        if line[1] <= 0.05 || low >= high {
            return None;
        }
        let unit = (high - low) / (RESPONSE_POINTS - 1) as f64;
        // The largest part of the polynomial that keeps the slopes.
        let response = (0..=MIXTURES).rev().map(|part| part as f64 / MIXTURES as f64).find_map(|part| {
            let at = |x: f64| part * value(&c, x) + (1.0 - part) * value(&line, x);
            let response: [f64; RESPONSE_POINTS] = std::array::from_fn(|i| at(low + unit * i as f64));
            let kept = response.windows(2).all(|pair| {
                let slope = (pair[1] - pair[0]) / unit / line[1];
                (SLOPES[0] - 1e-9..=SLOPES[1]).contains(&slope)
            });
            kept.then_some(response)
        })?;
        Some(Self { measured: [low, high], response: response.map(|v| v.clamp(-1.5, 1.5)) })
    }

    /// True normalised depth and slope at a measured one; `None` outside the learned range.
    pub fn at(&self, measured: f64) -> Option<[f64; 2]> {
        interpolated(self.measured, &self.response, measured)
    }
}

/// Coefficients of the polynomial from measured to true, by least squares with Huber's weights.
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
        // Keeps what few depths leave undetermined straight.
        for i in 0..n {
            normal[(i, i)] += if i > 1 { 1e-4 } else { 1e-9 } * sizes.len() as f64;
        }
        found = normal.lu().solve(&right)?.iter().copied().collect();
        let middle = sizes.len() / 2;
        limit = (1.5 * 1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1).max(1e-4);
    }
    Some(found)
}

fn value(c: &[f64], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(measured_of: impl Fn(f64) -> f64, truths: impl Iterator<Item = f64>) -> Vec<Sample> {
        truths.map(|truth| Sample::exact(measured_of(truth), truth)).collect()
    }

    #[test]
    fn a_bent_response_is_learned_and_ends_where_the_samples_do() {
        let bent = |t: f64| 0.1 + 0.8 * t + 0.15 * t.powi(3);
        let learned = samples(bent, (0..400).map(|i| -0.9 + 1.8 * f64::from(i) / 399.0));
        let curve = Curve::fit(learned.iter(), 5).unwrap();
        for truth in [-0.85, -0.3, 0.0, 0.5, 0.88] {
            let [found, slope] = curve.at(bent(truth)).unwrap();
            assert!((found - truth).abs() < 0.01, "{truth} {found}");
            let expected = 1.0 / (0.8 + 0.45 * truth * truth);
            assert!((slope - expected).abs() < 0.15 * expected, "{truth} {slope} {expected}");
        }
        assert!(curve.at(bent(1.05)).is_none(), "no depth beyond the learned range");
        let falling = samples(|t| -t, (0..400).map(|i| -1.0 + f64::from(i) / 200.0));
        assert_eq!(Curve::fit(falling.iter(), 3), None);
    }

    /// Two depths with noise: their best polynomial is flat at either and useless for other scenes.
    #[test]
    fn two_known_depths_make_no_plateaus() {
        let learned: Vec<Sample> = (0..2000)
            .map(|i| {
                let truth = if i % 2 == 0 { -0.5 } else { 0.5 };
                Sample::exact(truth + 0.3 * ((i as f64 * 0.618).fract() - 0.5), truth)
            })
            .collect();
        for degree in [1, 3, 5] {
            let curve = Curve::fit(learned.iter(), degree).unwrap();
            let unit = (curve.measured[1] - curve.measured[0]) / (RESPONSE_POINTS - 1) as f64;
            let slopes = curve.response.windows(2).map(|pair| (pair[1] - pair[0]) / unit);
            assert!(
                slopes.clone().all(|slope| (0.2..3.1).contains(&slope)),
                "{degree} {:?}",
                slopes.collect::<Vec<_>>()
            );
        }
    }
}
