//! A small network over a clip's frames: two layers per frame, mean and maximum over the clip, a third layer
//! (deep sets: Zaheer et al., NeurIPS 2017; Qi et al., CVPR 2017). The third layer's output is the pattern.
//!
//! Mean and maximum ignore the order. Order enters by the frames' motion ([`super::frames`]) and by a second
//! layer that sees neighbouring frames, zero beyond the clip (Waibel et al., IEEE TASSP 37, 1989). Training
//! is supervised and needs tens of thousands of clips, e.g. of synthetic people. O(frames x (F x 64 + 5 x 64
//! x 128)) per clip and member. The outputs of several members are concatenated, which is better calibrated
//! and more accurate (Lakshminarayanan et al., NeurIPS 2017).

pub mod features;
pub mod recogniser;
pub mod training;
pub mod variation;

use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate, s};
use serde::{Deserialize, Serialize};

/// A layer: inputs x outputs, and the bias.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dense {
    /// Weights, inputs x outputs.
    pub weights: Array2<f32>,
    /// Offsets, one per output.
    pub offsets: Array1<f32>,
}

impl Dense {
    /// Applies the layer row by row.
    pub fn apply(&self, inputs: ArrayView2<f32>) -> Array2<f32> {
        inputs.dot(&self.weights) + &self.offsets
    }

    fn mean_of(layers: &[Self]) -> Self {
        let share = 1.0 / layers.len().max(1) as f32;
        let weights: Vec<ArrayView2<f32>> = layers.iter().map(|layer| layer.weights.view()).collect();
        let outputs = layers.first().map_or(0, |layer| layer.offsets.len());
        Self {
            weights: concatenate(Axis(0), &weights).unwrap_or_default() * share,
            offsets: layers.iter().fold(Array1::zeros(outputs), |sum, layer| sum + &layer.offsets) * share,
        }
    }

    fn is(&self, inputs: usize, outputs: usize) -> bool {
        self.weights.dim() == (inputs, outputs) && self.offsets.len() == outputs
    }
}

/// A trained network with the statistics of its training frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Mean of the training frames.
    pub mean: Array1<f32>,
    /// Spread of the training frames.
    pub spread: Array1<f32>,
    /// Layers of every member.
    pub members: Vec<Layers>,
}

/// Two layers per frame, one per clip.
pub type Layers = [Dense; 3];

fn rectified(mut values: Array2<f32>) -> Array2<f32> {
    values.mapv_inplace(|v| v.max(0.0));
    values
}

/// Each row with its `reach` neighbours on both sides; zeros beyond the ends.
fn with_neighbours(rows: ArrayView2<f32>, reach: usize) -> Array2<f32> {
    let (n, width) = rows.dim();
    let mut out = Array2::zeros((n, (2 * reach + 1) * width));
    for (place, from) in (0..=2 * reach).map(|place| (place, place * width)) {
        // Row i is at this place of row i + reach - place.
        let (begin, shift) = (reach.saturating_sub(place).min(n), place.saturating_sub(reach).min(n));
        let count = n - begin - shift;
        out.slice_mut(s![begin..begin + count, from..from + width])
            .assign(&rows.slice(s![shift..shift + count, ..]));
    }
    out
}

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
    /// Length of a pattern.
    pub fn width(&self) -> usize {
        self.members.iter().map(width).sum()
    }

    /// Pattern of frame vectors (frames x F): outputs of the members' third layers; zeros for an empty clip.
    pub fn pattern(&self, frames: ArrayView2<f32>) -> Array1<f32> {
        let mut out = Array1::zeros(self.width());
        if frames.nrows() == 0 {
            return out;
        }
        let inputs = (&frames - &self.mean) / &self.spread;
        let mut from = 0;
        for member in &self.members {
            let to = from + width(member);
            out.slice_mut(s![from..to]).assign(&values(member, inputs.view()));
            from = to;
        }
        out
    }

    /// Whether all sizes match each other and frame vectors of `inputs` numbers.
    pub fn fits(&self, inputs: usize) -> bool {
        !self.members.is_empty()
            && self.members.iter().all(|member| layers_fit(member, inputs))
            && [self.mean.len(), self.spread.len()] == [inputs; 2]
            && self.spread.iter().all(|v| *v > 0.0)
    }
}

fn width([_, _, third]: &Layers) -> usize {
    third.offsets.len()
}

fn values(member: &Layers, inputs: ArrayView2<f32>) -> Array1<f32> {
    let [first, second, third] = member;
    let hidden = rectified(first.apply(inputs));
    let seen = rectified(second.apply(with_neighbours(hidden.view(), reach(member)).view()));
    let clip = pooled(seen.view()).insert_axis(Axis(0));
    rectified(third.apply(clip.view())).remove_axis(Axis(0))
}

/// Neighbours on each side seen by a member's second layer.
fn reach([first, second, _]: &Layers) -> usize {
    second.weights.nrows() / first.offsets.len().max(1) / 2
}

fn layers_fit(member: &Layers, inputs: usize) -> bool {
    let [first, second, third] = member;
    let (a, b, c) = (first.offsets.len(), second.offsets.len(), third.offsets.len());
    let neighbours = 2 * reach(member) + 1;
    first.is(inputs, a) && second.is(neighbours * a, b) && third.is(2 * b, c)
}

fn rows(matrix: &Array2<f32>, from: usize, to: usize) -> ArrayView2<'_, f32> {
    matrix.slice(s![from..to, ..])
}

#[cfg(test)]
mod tests {
    use super::training::{NetworkSettings, train};
    use super::variation::Embedded;
    use super::*;
    use crate::watch::Unwatched;

    fn clips() -> (Vec<Embedded>, Vec<usize>) {
        let clip = |n: usize| {
            let points = Array2::from_shape_fn((3 + n % 4, 4), |(frame, k)| {
                ((n * 7 + frame * 5 + k * (1 + n % 3)) % 13) as f32 / 6.0
            });
            Embedded { points, boxes: None }
        };
        ((0..40).map(clip).collect(), (0..40).map(|n| n % 3).collect())
    }

    #[test]
    fn members_are_concatenated_and_averaged() {
        let (clips, labels) = clips();
        let trained = |members: usize, seed: u64| {
            let settings = NetworkSettings {
                widths: [5, 6, 7],
                passes: 2,
                batch: 8,
                reach: 1,
                members,
                seed,
                ..NetworkSettings::default()
            };
            train(&clips, &|clip| clip.points.clone(), &labels, 3, &settings, &Unwatched)
                .expect("not stopped")
        };
        let ((both, of_both), (one, of_one), (other, of_other)) =
            (trained(2, 4), trained(1, 4), trained(1, 5));
        assert_eq!((both.width(), one.width(), both.members.len()), (14, 7, 2));
        assert!(both.fits(4) && !both.fits(5) && of_both.is(14, 3));
        for clip in &clips {
            let [pattern, a, b] = [&both, &one, &other].map(|network| network.pattern(clip.points.view()));
            assert_eq!(pattern.to_vec(), [a.to_vec(), b.to_vec()].concat());
            let decision = |pattern: &Array1<f32>, last: &Dense| pattern.dot(&last.weights) + &last.offsets;
            let mean = (decision(&a, &of_one) + decision(&b, &of_other)) / 2.0;
            let together = decision(&pattern, &of_both);
            assert!(together.iter().zip(&mean).all(|(x, y)| (x - y).abs() < 1e-4), "{together} {mean}");
        }
        assert_eq!(both.pattern(clips[0].points.slice(s![..0, ..])), Array1::<f32>::zeros(14));
    }

    #[test]
    fn an_empty_ensemble_and_a_member_of_another_width_are_rejected() {
        let (clips, labels) = clips();
        let settings = NetworkSettings { widths: [5, 6, 7], passes: 1, members: 2, ..Default::default() };
        let (whole, _) = train(&clips, &|clip| clip.points.clone(), &labels, 3, &settings, &Unwatched)
            .expect("not stopped");
        let mut network = whole.clone();
        network.members.clear();
        assert!(!network.fits(4));
        let mut network = whole;
        network.members[1][1].offsets = Array1::zeros(9);
        assert!(!network.fits(4));
    }
}
