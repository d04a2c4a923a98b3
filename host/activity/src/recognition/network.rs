//! A small network over the frames of a clip: every frame goes through the same two layers, mean and largest of what comes out over the
//! clip go through a third (deep sets: Zaheer et al., NeurIPS 2017; Qi et al., CVPR 2017).
//!
//! Mean and largest do not know the order of frames, so that what shuffling leaves unchanged stays unchanged; order comes in by the
//! frames' own motion ([`super::frames`]) and, where order counts, by a second layer that sees neighbours too: a frame with some before
//! and behind it, nothing beyond the clip's ends (a convolution over time; Waibel et al., IEEE TASSP 37, 1989). How many is told by the layer's size.
//! A clip's pattern is what the third layer gives. Unlike a codebook it is learned with the activities' names, and needs many more clips: tens of
//! thousands, which synthetic people can give. O(frames x (F x 64 + 5 x 64 x 128)) a clip.

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

/// Every row with `reach` before and behind it side by side; zeros where there is none.
fn with_neighbours(rows: ArrayView2<f32>, reach: usize) -> Array2<f32> {
    let (n, width) = rows.dim();
    let mut out = Array2::zeros((n, (2 * reach + 1) * width));
    for (place, from) in (0..=2 * reach).map(|place| (place, place * width)) {
        // Row i stands at this place of row i + reach - place.
        let (begin, shift) = (reach.saturating_sub(place).min(n), place.saturating_sub(reach).min(n));
        let count = n - begin - shift;
        out.slice_mut(s![begin..begin + count, from..from + width])
            .assign(&rows.slice(s![shift..shift + count, ..]));
    }
    out
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
        let hidden = rectified(first.apply(inputs.view()));
        let seen = rectified(second.apply(with_neighbours(hidden.view(), self.reach()).view()));
        let clip = pooled(seen.view()).insert_axis(Axis(0));
        rectified(third.apply(clip.view())).remove_axis(Axis(0))
    }

    /// Frames before and behind a frame that its second layer sees.
    fn reach(&self) -> usize {
        let [first, second, _] = &self.layers;
        second.weights.nrows() / first.offsets.len().max(1) / 2
    }

    /// Whether all sizes fit one another and frame vectors of `inputs` numbers.
    pub fn fits(&self, inputs: usize) -> bool {
        let [first, second, third] = &self.layers;
        let (a, b, c) = (first.offsets.len(), second.offsets.len(), third.offsets.len());
        let neighbours = 2 * self.reach() + 1;
        let layers = first.is(inputs, a) && second.is(neighbours * a, b) && third.is(2 * b, c);
        layers && [self.mean.len(), self.spread.len()] == [inputs; 2] && self.spread.iter().all(|v| *v > 0.0)
    }
}

/// Rows of a matrix from `from` to `to`.
fn rows(matrix: &Array2<f32>, from: usize, to: usize) -> ArrayView2<'_, f32> {
    matrix.slice(s![from..to, ..])
}
