//! Principal components, for comparison with Isomap.

use super::{EmbeddingError, check, spectral};
use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

/// Mean and leading principal directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pca {
    /// Mean of the training samples.
    pub mean: Array1<f32>,
    /// Unit directions, one per row.
    pub directions: Array2<f32>,
    /// Variance along each direction.
    pub variances: Vec<f64>,
}

impl Pca {
    /// Fits to `samples` (N x d), O(N d^2 + d^3). Fails for too few or non-finite samples or no variance.
    pub fn fit(samples: ArrayView2<f32>, dimensions: usize) -> Result<Self, EmbeddingError> {
        check(samples, 2)?;
        let mean = samples.mean_axis(Axis(0)).unwrap_or_else(|| Array1::zeros(samples.ncols()));
        let centred = (&samples - &mean).mapv(f64::from);
        let d = samples.ncols();
        let covariance = centred.t().dot(&centred) / (samples.nrows() - 1) as f64;
        let flat: Vec<f64> = covariance.iter().copied().collect();
        let (variances, vectors) = spectral::leading(&flat, d, dimensions);
        if variances.len() < dimensions {
            return Err(EmbeddingError::TooFewDimensions { found: variances.len(), asked: dimensions });
        }
        let directions = Array2::from_shape_fn((dimensions, d), |(k, j)| vectors[k][j] as f32);
        Ok(Self { mean, directions, variances })
    }

    /// Coordinates of samples (N x d) along the directions (N x D); fails for another width.
    pub fn transform(&self, samples: ArrayView2<f32>) -> Result<Array2<f32>, EmbeddingError> {
        if samples.ncols() != self.mean.len() {
            return Err(EmbeddingError::Shape {
                what: "width of the samples",
                expected: self.mean.len(),
                found: samples.ncols(),
            });
        }
        Ok((&samples - &self.mean).dot(&self.directions.t()))
    }
}
