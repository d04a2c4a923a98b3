//! Fit data of the published procedures: the NIR at each grid point and depth, with weights.

use nalgebra::{DMatrix, DVector};

use super::DesignError;
use super::least_squares::solve;
use super::linear::weights;
use crate::kernel::{self, Kernel};
use crate::normalised_ratio::{GridPoint, alphas, normalised_ratio};
use crate::psf::Otf;

/// One grid point and depth.
pub(super) struct Sample {
    /// Index of the point's basis responses.
    pub point: usize,
    pub alpha: f64,
    pub normalised_ratio: f64,
    /// Square root of the weight.
    pub weight: f64,
}

pub(super) struct Samples {
    size: usize,
    pub basis: Vec<Vec<f64>>,
    pub gp1: Vec<f64>,
    pub samples: Vec<Sample>,
}

impl Samples {
    pub fn new(otf: &Otf, max_blur_px: f64, prefilter: &Kernel, grid: &[GridPoint], gp1: &Kernel) -> Self {
        let size = gp1.size();
        let weights = weights(prefilter, grid);
        let basis = grid.iter().map(|p| kernel::basis_responses(size, p.u, p.v)).collect();
        let samples = grid
            .iter()
            .zip(&weights)
            .enumerate()
            .flat_map(|(point, (p, weight))| {
                alphas().map(|alpha| Sample {
                    point,
                    alpha,
                    normalised_ratio: normalised_ratio(otf, max_blur_px, p.w, alpha),
                    weight: weight.sqrt(),
                })
            })
            // Where both OTFs vanish the image is empty.
            .filter(|sample| sample.normalised_ratio.is_finite())
            .collect();
        Self { size, basis, gp1: grid.iter().map(|p| gp1.response(p.u, p.v)).collect(), samples }
    }

    pub fn taps(&self) -> usize {
        kernel::free_coefficients(self.size)
    }

    /// The kernel `G` that minimises `sum w (factor G - target)^2` over the samples.
    pub fn fit(
        &self,
        factor: impl Fn(&Sample) -> f64,
        target: impl Fn(&Sample) -> f64,
    ) -> Result<Kernel, DesignError> {
        let matrix = DMatrix::from_fn(self.samples.len(), self.taps(), |i, j| {
            let sample = &self.samples[i];
            sample.weight * factor(sample) * self.basis[sample.point][j]
        });
        let rhs =
            DVector::from_iterator(self.samples.len(), self.samples.iter().map(|s| s.weight * target(s)));
        Ok(Kernel::new(self.size, solve(matrix, rhs)?.as_slice().to_vec())?)
    }

    pub fn response(&self, taps: &[f64], sample: &Sample) -> f64 {
        self.basis[sample.point].iter().zip(taps).map(|(b, t)| b * t).sum()
    }
}
