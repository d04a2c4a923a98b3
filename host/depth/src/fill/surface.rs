//! The cubic surface of Li 2014, eq. 6.16, fitted robustly and with no more terms than the samples support.

use nalgebra::{DMatrix, DVector};

use super::Sample;

/// Terms of the plane, the quadratic and the cubic surface: 1, x, y, x^2, y^2, x^3, y^3.
const TERMS: [usize; 3] = [3, 5, 7];

/// Neighbouring samples share their smoothing window (7x7): this many count as one.
const SAMPLES_PER_INDEPENDENT: f64 = 49.0;

/// Fewest samples for any fit.
const MIN_SAMPLES: usize = 12;

/// Huber's constant: residuals beyond this many robust standard deviations lose weight.
const HUBER: f64 = 1.345;

/// Rounds of reweighting.
const ROUNDS: usize = 4;

/// At most about this many samples are used; more only repeat each other.
const MAX_SAMPLES: usize = 800;

/// A fitted surface.
pub(super) struct Surface {
    centre: [f64; 2],
    scale: f64,
    coefficients: Vec<f64>,
    /// Depths of the margin, beyond which the surface is not trusted by more than their spread.
    limits: [f64; 2],
}

fn terms(y: f64, x: f64) -> [f64; 7] {
    [1.0, x, y, x * x, y * y, x * x * x, y * y * y]
}

impl Surface {
    /// Fits the samples; none if there are too few.
    pub fn fit(samples: &[Sample]) -> Option<Self> {
        if samples.len() < MIN_SAMPLES {
            return None;
        }
        let step = samples.len().div_ceil(MAX_SAMPLES);
        let samples: Vec<Sample> = samples.iter().copied().step_by(step).collect();
        let n = samples.len() as f64;
        let mean = |of: fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>() / n;
        let centre = [mean(|s| s.y), mean(|s| s.x)];
        let reach = |s: &Sample| (s.y - centre[0]).abs().max((s.x - centre[1]).abs());
        let scale = samples.iter().map(reach).fold(1.0, f64::max);
        let rows: Vec<[f64; 7]> =
            samples.iter().map(|s| terms((s.y - centre[0]) / scale, (s.x - centre[1]) / scale)).collect();
        let independent = (n * step as f64 / SAMPLES_PER_INDEPENDENT).max(1.0);
        let (_, coefficients) = TERMS
            .into_iter()
            .filter_map(|count| {
                let (coefficients, variance) = fit_robustly(&rows, &samples, count)?;
                let information =
                    independent * variance.max(1e-12).ln() + count as f64 * independent.ln().max(1.0);
                Some((information, coefficients))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let depths = || samples.iter().map(|s| s.depth_mm);
        let [low, high] =
            [depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max)];
        let limits = [low - (high - low), high + (high - low)];
        Some(Self { centre, scale, coefficients, limits })
    }

    /// Depth at a pixel, mm.
    pub fn depth_mm(&self, y: usize, x: usize) -> f32 {
        let row = terms((y as f64 - self.centre[0]) / self.scale, (x as f64 - self.centre[1]) / self.scale);
        let depth: f64 = row.iter().zip(&self.coefficients).map(|(t, c)| t * c).sum();
        depth.clamp(self.limits[0], self.limits[1]) as f32
    }
}

/// Coefficients of the first `count` terms and the robust variance of the residuals; none if the samples do not
/// determine them.
fn fit_robustly(rows: &[[f64; 7]], samples: &[Sample], count: usize) -> Option<(Vec<f64>, f64)> {
    let mut weights: Vec<f64> = samples.iter().map(|s| s.confidence).collect();
    let mut result = None;
    for _ in 0..ROUNDS {
        let mut normal = DMatrix::<f64>::zeros(count, count);
        let mut rhs = DVector::<f64>::zeros(count);
        for ((row, sample), weight) in rows.iter().zip(samples).zip(&weights) {
            for i in 0..count {
                rhs[i] += weight * row[i] * sample.depth_mm;
                for j in 0..=i {
                    normal[(i, j)] += weight * row[i] * row[j];
                }
            }
        }
        // A hair of ridge: coordinates are within [-1, 1], so this is far below any real term.
        for i in 0..count {
            normal[(i, i)] *= 1.0 + 1e-10;
        }
        let coefficients = normal.cholesky()?.solve(&rhs);
        let residuals: Vec<f64> = rows
            .iter()
            .zip(samples)
            .map(|(row, s)| s.depth_mm - row.iter().zip(coefficients.iter()).map(|(t, c)| t * c).sum::<f64>())
            .collect();
        let mut sorted: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
        let middle = sorted.len() / 2;
        // The median absolute deviation of a normal distribution is 1 / 1.4826 of its standard deviation.
        let deviation = 1.4826 * *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        for ((weight, residual), sample) in weights.iter_mut().zip(&residuals).zip(samples) {
            let factor =
                if residual.abs() <= HUBER * deviation { 1.0 } else { HUBER * deviation / residual.abs() };
            *weight = sample.confidence * factor;
        }
        result = Some((coefficients.as_slice().to_vec(), deviation * deviation));
    }
    result
}
