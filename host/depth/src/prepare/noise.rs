//! The noise of a pair, from the pair itself.
//!
//! At the highest frequencies, towards (pi, pi), a lens out of focus leaves nothing: wherever the surface lies, at least one of
//! the images is out of focus, and what it has there is noise. So both images go through the second difference along both
//! axes (Immerkaer 1996), whose response peaks there, and of each block's two energies the smaller one counts. Blocks of
//! several brightnesses tell shot noise from the constant part.
//!
//! Cost: nine additions per pixel and image.

use ndarray::ArrayView2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Side of a block.
const BLOCK_PX: usize = 16;
/// Sum of the squared taps of the second difference along both axes.
const GAIN: f64 = 36.0;
/// Mean of the smaller of two independent estimates of one variance from a block's pixels, relative to the variance: the
/// estimates scatter by about 12 %, whose expected minimum lies 0.56 of that below.
const SMALLER_OF_TWO: f64 = 0.93;

/// Variance of a pixel's noise, in the images' units: `constant + per_unit x value`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PairNoise {
    /// Of a black pixel: read noise and quantisation.
    pub constant: f64,
    /// Shot noise; 0 where the images are too alike in brightness to tell.
    pub per_unit: f64,
    /// Mean over the image.
    pub mean_variance: f64,
}

impl PairNoise {
    /// Variance at a brightness.
    pub fn variance(&self, brightness: f64) -> f64 {
        (self.constant + self.per_unit * brightness).max(0.1 * self.mean_variance).max(f64::MIN_POSITIVE)
    }
}

/// The noise of a pair of one size; pixels without a value (NaN) do not count. `None` where no block is whole.
pub fn of_pair(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Option<PairNoise> {
    let (height, width) = far.dim();
    let [rows, columns] = [height, width].map(|n| n.saturating_sub(2) / BLOCK_PX);
    let mut blocks: Vec<[f64; 2]> = (0..rows * columns)
        .into_par_iter()
        .filter_map(|index| {
            let (top, left) = (index / columns * BLOCK_PX, index % columns * BLOCK_PX);
            let [a, b] = [&far, &near].map(|image| energy(image, top, left));
            let (variance, brightness) = (a[0].min(b[0]) / SMALLER_OF_TWO, 0.5 * (a[1] + b[1]));
            (variance.is_finite() && brightness.is_finite()).then_some([brightness, variance])
        })
        .collect();
    if blocks.is_empty() {
        return None;
    }
    blocks.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let median = |part: &[[f64; 2]], which: usize| {
        let mut values: Vec<f64> = part.iter().map(|block| block[which]).collect();
        values.sort_unstable_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let mean_variance = median(&blocks, 1);
    // Medians of the darkest and of the brightest quarter give the line.
    let quarter = (blocks.len() / 4).max(1);
    let [dark, bright] = [&blocks[..quarter], &blocks[blocks.len() - quarter..]];
    let [from, to] = [dark, bright].map(|part| [median(part, 0), median(part, 1)]);
    let slope = (to[1] - from[1]) / (to[0] - from[0]);
    let tells = to[0] - from[0] > 0.1 * to[0].abs() && slope.is_finite() && slope > 0.0;
    let per_unit = if tells { slope } else { 0.0 };
    let constant = if tells { from[1] - slope * from[0] } else { mean_variance };
    Some(PairNoise { constant, per_unit, mean_variance })
}

/// Variance of the noise of a block and its mean brightness.
fn energy(image: &ArrayView2<f32>, top: usize, left: usize) -> [f64; 2] {
    let (mut squares, mut sum) = (0.0_f64, 0.0_f64);
    for y in top + 1..=top + BLOCK_PX {
        for x in left + 1..=left + BLOCK_PX {
            let at = |dy: usize, dx: usize| image[(y + dy - 1, x + dx - 1)];
            let row = |dy: usize| at(dy, 0) - 2.0 * at(dy, 1) + at(dy, 2);
            let second = row(0) - 2.0 * row(1) + row(2);
            squares += f64::from(second * second);
            sum += f64::from(at(1, 1));
        }
    }
    let pixels = (BLOCK_PX * BLOCK_PX) as f64;
    [squares / pixels / GAIN, sum / pixels]
}
