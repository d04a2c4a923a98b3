//! Network outputs, normalised over the training clips, as features for another classifier.

use super::Network;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

/// A network and the statistics of its output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Features {
    /// Network learned from other clips.
    pub network: Network,
    /// Mean output over the training clips.
    pub mean: Array1<f32>,
    /// Scale to unit mean length.
    pub scale: Array1<f32>,
}

impl Features {
    /// From the network's outputs for the training clips, one per row.
    pub fn fitted(network: Network, values: ArrayView2<f32>) -> Self {
        let width = values.ncols();
        let mean = values.mean_axis(Axis(0)).unwrap_or_else(|| Array1::zeros(width));
        let spread = if values.nrows() > 0 { values.std_axis(Axis(0), 0.0) } else { Array1::zeros(width) };
        let unit = 1.0 / (width.max(1) as f32).sqrt();
        Self { network, mean, scale: spread.mapv(|v| if v > 1e-6 { unit / v } else { 0.0 }) }
    }

    /// Pattern of frame vectors (frames x F).
    pub fn pattern(&self, frames: ArrayView2<f32>) -> Array1<f32> {
        (self.network.pattern(frames) - &self.mean) * &self.scale
    }

    /// Whether all sizes match each other and frame vectors of `inputs` numbers.
    pub fn fits(&self, inputs: usize) -> bool {
        let width = self.network.width();
        self.network.fits(inputs) && [self.mean.len(), self.scale.len()] == [width; 2]
    }
}

pub(crate) fn values(network: &Network, clips: &[Array2<f32>]) -> Array2<f32> {
    let rows: Vec<Array1<f32>> = clips.iter().map(|frames| network.pattern(frames.view())).collect();
    Array2::from_shape_fn((rows.len(), network.width()), |(i, k)| rows[i][k])
}

#[cfg(test)]
mod tests {
    use super::super::Dense;
    use super::*;

    #[test]
    fn training_clips_have_patterns_of_unit_length_about_nothing() {
        let dense = |inputs: usize, outputs: usize| Dense {
            weights: Array2::from_shape_fn((inputs, outputs), |(i, k)| ((i * 7 + k * 3) % 5) as f32 - 1.5),
            offsets: Array1::from_elem(outputs, 0.5),
        };
        let network = Network {
            mean: Array1::zeros(3),
            spread: Array1::ones(3),
            members: vec![[dense(3, 4), dense(4, 5), dense(10, 6)]],
        };
        let clips: Vec<Array2<f32>> = (0..30)
            .map(|n| Array2::from_shape_fn((4, 3), |(f, k)| ((n * 5 + f * 3 + k) % 11) as f32 / 5.0))
            .collect();
        let features = Features::fitted(network.clone(), values(&network, &clips).view());
        assert!(features.fits(3) && !features.fits(4));
        let patterns: Vec<Array1<f32>> = clips.iter().map(|clip| features.pattern(clip.view())).collect();
        let mean = patterns.iter().fold(Array1::<f32>::zeros(6), |sum, p| sum + p);
        assert!(mean.iter().all(|v| v.abs() < 1e-3), "{mean}");
        let varying = features.scale.iter().filter(|s| **s > 0.0).count() as f32;
        let squared: f32 = patterns.iter().map(|p| p.dot(p)).sum::<f32>() / 30.0;
        assert!(varying > 0.0 && (squared - varying / 6.0).abs() < 1e-3, "{squared} {varying}");
    }
}
