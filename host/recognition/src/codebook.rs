//! A clip's pattern over a codebook of typical frames, the k-means centres of the training frames (cells of the thesis'
//! grid grow with the power of the dimensions). Each frame is assigned softly, to all centres by a Gaussian of its
//! distance. The mean assignment, independent of the order of frames, is square-rooted: the scalar product of two
//! patterns is the Bhattacharyya coefficient. An ordered pattern adds the same over the clip's halves and thirds; a
//! second, smaller codebook may add its [`super::residuals`].

use super::frames::Mode;
use super::residuals::residuals;
use crate::embedding::{rbf::exp_negative, squared_norms, times_transposed};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, s};
use rand::{Rng, SeedableRng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Typical frames with the width of their Gaussians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Codebook {
    /// Centres of k-means (M x F).
    pub centres: Array2<f32>,
    /// Mean squared distance of training frames to their nearest centre.
    pub spread: f32,
    /// Smaller codebook for residuals in the pattern.
    pub residual: Option<Box<Codebook>>,
}

const MOST_FRAMES: usize = 8000;
const ROUNDS: usize = 12;

impl Codebook {
    /// Clusters frames (N x F) into `size` centres by k-means++ and Lloyd's algorithm.
    pub fn train(frames: ArrayView2<f32>, size: usize, seed: u64) -> Self {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let step = frames.nrows().div_ceil(MOST_FRAMES).max(1);
        let sample = frames.slice(s![..;step, ..]);
        let n = sample.nrows();
        let mut centres = Array2::zeros((size.min(n), frames.ncols()));
        let mut nearest = vec![f32::INFINITY; n];
        let mut pick = if n > 0 { rng.random_range(0..n) } else { 0 };
        for m in 0..centres.nrows() {
            centres.row_mut(m).assign(&sample.row(pick));
            for (near, frame) in nearest.iter_mut().zip(sample.rows()) {
                *near = near.min(squared(frame, centres.row(m)));
            }
            let total: f64 = nearest.iter().map(|d| f64::from(*d)).sum();
            let mut at = rng.random_range(0.0..1.0) * total;
            pick = nearest
                .iter()
                .position(|d| {
                    at -= f64::from(*d);
                    at <= 0.0
                })
                .unwrap_or(n.saturating_sub(1));
        }
        let mut spread = 0.0;
        for _ in 0..ROUNDS {
            let assigned = assigned(sample, &centres);
            let mut sums = Array2::<f32>::zeros(centres.dim());
            let mut counts = vec![0_u32; centres.nrows()];
            for ((m, _), frame) in assigned.iter().zip(sample.rows()) {
                sums.row_mut(*m).scaled_add(1.0, &frame);
                counts[*m] += 1;
            }
            for (m, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                centres.row_mut(m).assign(&(&sums.row(m) / count as f32));
            }
            spread = assigned.iter().map(|(_, d)| d).sum::<f32>() / n.max(1) as f32;
        }
        Self { centres, spread, residual: None }
    }

    /// Adds residuals of `size` further centres; 0 for none.
    #[must_use]
    pub fn with_residuals(mut self, frames: ArrayView2<f32>, size: usize, seed: u64) -> Self {
        self.residual = (size > 0).then(|| Box::new(Self::train(frames, size, seed)));
        self
    }

    /// Length of a pattern.
    pub fn pattern_width(&self, mode: Mode) -> Option<usize> {
        let residual = self.residual.as_ref().map_or(0, |book| book.centres.len());
        self.centres.nrows().checked_mul(segments(mode).len())?.checked_add(residual)
    }

    /// Soft assignments (frames x M) with row sums of 1. `sharpness` 1 is the spread of the training frames.
    pub fn soft_assignments(&self, frames: ArrayView2<f32>, sharpness: f32) -> Array2<f32> {
        // |f - c|^2 without |f|^2, which cancels in the normalisation.
        let norms = squared_norms(self.centres.view());
        let mut assignments = times_transposed(frames, self.centres.view());
        let scale = sharpness / self.spread.max(1e-9);
        for mut row in assignments.rows_mut() {
            let Some(row) = row.as_slice_mut() else { continue };
            pulp::Arch::new().dispatch(|| {
                for (value, norm) in row.iter_mut().zip(&norms) {
                    *value = norm - 2.0 * *value;
                }
                let nearest = row.iter().fold(f32::INFINITY, |m, d| if *d < m { *d } else { m });
                for value in row.iter_mut() {
                    *value = exp_negative(scale * (*value - nearest));
                }
            });
            let total: f32 = row.iter().sum();
            row.iter_mut().for_each(|v| *v /= total);
        }
        assignments
    }

    /// Pattern of frame vectors (frames x F); zeros for an empty clip.
    pub fn pattern(&self, frames: ArrayView2<f32>, mode: Mode, sharpness: f32) -> Array1<f32> {
        let size = self.centres.nrows();
        let assignments = self.soft_assignments(frames, sharpness);
        let segments = segments(mode);
        let mut pattern = Array1::zeros(size * segments.len());
        for (k, &(part, of)) in segments.iter().enumerate() {
            let (from, to) =
                (part * assignments.nrows() / of, ((part + 1) * assignments.nrows()).div_ceil(of));
            let mut out = pattern.slice_mut(s![k * size..(k + 1) * size]);
            for assigned in assignments.slice(s![from..to.min(assignments.nrows()), ..]).rows() {
                out += &assigned;
            }
            let weight = 1.0 / (of as f32 * (to - from).max(1) as f32);
            out.mapv_inplace(|v| (v * weight).sqrt());
        }
        if let Some(book) = &self.residual {
            let assignments = book.soft_assignments(frames, sharpness);
            let more = residuals(book.centres.view(), frames, assignments.view());
            pattern = [pattern.to_vec(), more.to_vec()].concat().into();
        }
        pattern
    }
}

fn assigned(frames: ArrayView2<f32>, centres: &Array2<f32>) -> Vec<(usize, f32)> {
    let (lengths, norms) = (squared_norms(frames), squared_norms(centres.view()));
    let products = times_transposed(frames, centres.view());
    products
        .outer_iter()
        .into_par_iter()
        .zip(lengths)
        .map(|(products, length)| {
            let distances = products.iter().zip(&norms).map(|(product, norm)| norm - 2.0 * product);
            let (nearest, distance) = distances
                .enumerate()
                .fold((0, f32::INFINITY), |best, (m, d)| if d < best.1 { (m, d) } else { best });
            (nearest, (distance + length).max(0.0))
        })
        .collect()
}

/// Parts of a clip in a pattern: (index, count).
fn segments(mode: Mode) -> &'static [(usize, usize)] {
    match mode {
        Mode::OrderFree => &[(0, 1)],
        Mode::Ordered => &[(0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3)],
    }
}

fn squared(a: ArrayView1<f32>, b: ArrayView1<f32>) -> f32 {
    a.iter().zip(b).map(|(p, q)| (p - q) * (p - q)).sum()
}

pub(crate) fn stacked<'a>(parts: impl Iterator<Item = ArrayView2<'a, f32>>) -> Array2<f32> {
    let parts: Vec<_> = parts.collect();
    ndarray::concatenate(Axis(0), &parts).unwrap_or_else(|_| Array2::zeros((0, 0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_find_clusters_and_patterns_ignore_order_only_when_order_free() {
        let frames = Array2::from_shape_fn((90, 2), |(i, k)| {
            (i / 30) as f32 * 10.0 + (i % 5) as f32 * 0.01 * (k + 1) as f32
        });
        let book = Codebook::train(frames.view(), 3, 1);
        let mut firsts: Vec<f32> = book.centres.column(0).to_vec();
        firsts.sort_by(f32::total_cmp);
        assert!(
            (firsts[0]).abs() < 0.1 && (firsts[1] - 10.0).abs() < 0.1 && (firsts[2] - 20.0).abs() < 0.1,
            "{firsts:?}"
        );
        let reversed = frames.slice(s![..;-1, ..]);
        let free = |f: ArrayView2<f32>| book.pattern(f, Mode::OrderFree, 1.0);
        assert!((&free(frames.view()) - &free(reversed)).iter().all(|d| d.abs() < 1e-6));
        assert!((free(frames.view()).mapv(|v| v * v).sum() - 1.0).abs() < 1e-5);
        let ordered = |f: ArrayView2<f32>| book.pattern(f, Mode::Ordered, 1.0);
        assert!((&ordered(frames.view()) - &ordered(reversed)).iter().any(|d| d.abs() > 0.1));
    }
}
