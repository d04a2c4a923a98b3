//! The surface fitted to a margin: a polynomial of up to third order, from the widest margin that agrees with it.
//!
//! Wide margins give more samples and separate curvature from noise: in the middle of a disc of radius R the standard
//! deviation of a quadratic surface is about eight times less with a margin of R than of R / 4. But far away a cubic
//! follows the surface less, and other surfaces appear. So the margin is widened by factors of three while the wider
//! fit explains the nearest samples as well as their own fit (robust spread within [`TOLERANCE`]).

use nalgebra::{SMatrix, SVector};

use super::Sample;
use crate::median::deviation;

const MIN_SAMPLES: usize = 12;

/// Huber's constant: residuals beyond this many robust standard deviations lose weight.
const HUBER: f64 = 1.345;

const ROUNDS: usize = 3;

/// Width of the narrowest margin for comparison, px.
const NARROW_PX: usize = 7;

/// Largest growth of the nearest samples' spread when the margin is widened.
const TOLERANCE: f64 = 1.25;

pub(super) struct Surface {
    frame: Frame,
    coefficients: Vec<f64>,
    /// Depths of the margin; the surface may exceed them by their spread.
    limits: [f64; 2],
}

#[derive(Clone, Copy)]
struct Frame {
    centre: [f64; 2],
    scale: f64,
}

impl Frame {
    fn of(samples: &[Sample]) -> Self {
        let n = samples.len() as f64;
        let mean = |of: fn(&Sample) -> f64| samples.iter().map(of).sum::<f64>() / n;
        let centre = [mean(|s| s.y), mean(|s| s.x)];
        let reach = |s: &Sample| (s.y - centre[0]).abs().max((s.x - centre[1]).abs());
        Self { centre, scale: samples.iter().map(reach).fold(1.0, f64::max) }
    }

    fn terms(self, y: f64, x: f64) -> [f64; 10] {
        let [y, x] = [(y - self.centre[0]) / self.scale, (x - self.centre[1]) / self.scale];
        [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y]
    }
}

impl Surface {
    /// Fits the samples, nearest first; `None` if there are too few.
    pub fn fit(samples: &[Sample]) -> Option<Self> {
        let within = |width_px: usize| &samples[..samples.partition_point(|s| s.distance_px <= width_px)];
        let widest = samples.last()?.distance_px;
        let mut width_px = NARROW_PX;
        let mut best: Option<(Self, f64)> = None;
        loop {
            if let Some(surface) = Self::fit_all(within(width_px)) {
                let spread = surface.spread_mm(within(NARROW_PX));
                match &best {
                    // Spreads below 1 um are equal.
                    Some((_, narrow)) if spread > TOLERANCE * narrow.max(1e-3) => break,
                    Some((_, narrow)) => best = Some((surface, narrow.max(1e-3))),
                    None => best = Some((surface, spread)),
                }
            }
            if width_px >= widest {
                break;
            }
            width_px *= 3;
        }
        best.map(|(surface, _)| surface)
    }

    /// Fits all samples with as many terms as they support: plane, quadratic or cubic.
    fn fit_all(samples: &[Sample]) -> Option<Self> {
        if samples.len() < MIN_SAMPLES {
            return None;
        }
        let frame = Frame::of(samples);
        let rows: Vec<[f64; 10]> = samples.iter().map(|s| frame.terms(s.y, s.x)).collect();
        let independent = samples.iter().map(|s| s.independent).sum::<f64>().max(1.0);
        let fits = [
            fit_robustly::<3>(&rows, samples),
            fit_robustly::<6>(&rows, samples),
            fit_robustly::<10>(&rows, samples),
        ];
        let (_, coefficients) = fits
            .into_iter()
            .flatten()
            .map(|(coefficients, variance)| {
                let count = coefficients.len();
                let information =
                    independent * variance.max(1e-12).ln() + count as f64 * independent.ln().max(1.0);
                (information, coefficients)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let depths = || samples.iter().map(|s| s.depth_mm);
        let [low, high] =
            [depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max)];
        Some(Self { frame, coefficients, limits: [low - (high - low), high + (high - low)] })
    }

    fn spread_mm(&self, samples: &[Sample]) -> f64 {
        deviation(samples.iter().map(|s| s.depth_mm - self.value(s.y, s.x))).unwrap_or(0.0)
    }

    fn value(&self, y: f64, x: f64) -> f64 {
        self.frame.terms(y, x).iter().zip(&self.coefficients).map(|(t, c)| t * c).sum()
    }

    pub fn depth_mm(&self, y: usize, x: usize) -> f32 {
        self.value(y as f64, x as f64).clamp(self.limits[0], self.limits[1]) as f32
    }
}

/// First `N` coefficients and the robust residual variance; `None` if the samples do not determine them.
fn fit_robustly<const N: usize>(rows: &[[f64; 10]], samples: &[Sample]) -> Option<(Vec<f64>, f64)> {
    let rows = || rows.iter().map(|row| *row.first_chunk::<N>().unwrap_or(&[0.0; N]));
    let mut weights: Vec<f64> = samples.iter().map(|s| s.weight).collect();
    let mut result = None;
    for _ in 0..ROUNDS {
        let mut normal = [[0.0; N]; N];
        let mut rhs = [0.0; N];
        for ((row, sample), weight) in rows().zip(samples).zip(&weights) {
            for i in 0..N {
                let weighted = weight * row[i];
                rhs[i] += weighted * sample.depth_mm;
                normal[i].iter_mut().zip(&row).for_each(|(sum, term)| *sum += weighted * term);
            }
        }
        // A small ridge: coordinates are within [-1, 1], so it is far below any real term.
        (0..N).for_each(|i| normal[i][i] *= 1.0 + 1e-10);
        let normal = SMatrix::<f64, N, N>::from_fn(|i, j| normal[i][j]);
        let coefficients = normal.cholesky()?.solve(&SVector::from(rhs));
        // Residuals of samples with less weight are larger: scale each by its expectation.
        let outlying: Vec<f64> = rows()
            .zip(samples)
            .map(|(row, s)| {
                let value: f64 = row.iter().zip(coefficients.iter()).map(|(t, c)| t * c).sum();
                (s.depth_mm - value).abs() * (s.weight / s.independent).sqrt()
            })
            .collect();
        let spread = deviation(outlying.iter().copied()).unwrap_or(0.0);
        let limit = (HUBER * spread).max(f64::MIN_POSITIVE);
        for ((weight, outlying), sample) in weights.iter_mut().zip(&outlying).zip(samples) {
            *weight = sample.weight / (outlying / limit).max(1.0);
        }
        result = Some((coefficients.as_slice().to_vec(), spread * spread));
    }
    result
}
