//! A small network over the frames of a clip: every frame goes through the same two layers, mean and largest of what comes out over the
//! clip go through a third (deep sets: Zaheer et al., NeurIPS 2017; Qi et al., CVPR 2017).
//!
//! Mean and largest do not know the order of frames, so that what shuffling leaves unchanged stays unchanged; order comes in by the
//! frames' own motion ([`super::frames`]). A clip's pattern is what the third layer gives. Unlike a codebook it is learned with the
//! activities' names, and needs many more clips: thousands, which synthetic people can give. O(frames x (F x 64 + 64 x 128)) a clip.

pub mod features;
pub mod recogniser;
pub mod training;

use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use serde::{Deserialize, Serialize};

/// A layer: inputs x outputs, and what is added.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dense {
    /// Inputs x outputs.
    pub weights: Array2<f32>,
    /// One per output.
    pub offsets: Array1<f32>,
}

impl Dense {
    /// The layer's answer, row by row.
    pub fn apply(&self, inputs: ArrayView2<f32>) -> Array2<f32> {
        inputs.dot(&self.weights) + &self.offsets
    }

    /// Whether the weights are inputs x outputs and the offsets fit.
    fn is(&self, inputs: usize, outputs: usize) -> bool {
        self.weights.dim() == (inputs, outputs) && self.offsets.len() == outputs
    }
}

/// The trained network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Mean of the training frames, subtracted first.
    pub mean: Array1<f32>,
    /// Spread of the training frames, divided by.
    pub spread: Array1<f32>,
    /// Two layers of a frame, then one of a clip.
    pub layers: [Dense; 3],
}

/// What is below zero becomes zero.
fn rectified(mut values: Array2<f32>) -> Array2<f32> {
    values.mapv_inplace(|v| v.max(0.0));
    values
}

/// Mean and largest of the rows, side by side.
fn pooled(rows: ArrayView2<f32>) -> Array1<f32> {
    let (n, width) = rows.dim();
    let mut out = Array1::zeros(2 * width);
    for row in rows.rows() {
        for (k, &value) in row.iter().enumerate() {
            out[k] += value / n as f32;
            out[width + k] = value.max(out[width + k]);
        }
    }
    out
}

impl Network {
    /// Numbers of a clip's pattern.
    pub fn width(&self) -> usize {
        self.layers[2].offsets.len()
    }

    /// The clip's pattern from its frame vectors (frames x F): values of the third layer; zeros for an empty clip.
    pub fn pattern(&self, frames: ArrayView2<f32>) -> Array1<f32> {
        if frames.nrows() == 0 {
            return Array1::zeros(self.width());
        }
        let inputs = (&frames - &self.mean) / &self.spread;
        let [first, second, third] = &self.layers;
        let seen = rectified(second.apply(rectified(first.apply(inputs.view())).view()));
        let clip = pooled(seen.view()).insert_axis(Axis(0));
        rectified(third.apply(clip.view())).remove_axis(Axis(0))
    }

    /// Whether all sizes fit one another and frame vectors of `inputs` numbers.
    pub fn fits(&self, inputs: usize) -> bool {
        let [first, second, third] = &self.layers;
        let (a, b, c) = (first.offsets.len(), second.offsets.len(), third.offsets.len());
        let layers = first.is(inputs, a) && second.is(a, b) && third.is(2 * b, c);
        layers && [self.mean.len(), self.spread.len()] == [inputs; 2] && self.spread.iter().all(|v| *v > 0.0)
    }
}

/// Rows of a matrix from `from` to `to`.
fn rows(matrix: &Array2<f32>, from: usize, to: usize) -> ArrayView2<'_, f32> {
    matrix.slice(s![from..to, ..])
}
