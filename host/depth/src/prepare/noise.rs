//! The noise of a pair, from the pair itself.
//!
//! At the highest frequencies, towards (pi, pi), defocus leaves no signal, and at any depth at least one image is out
//! of focus. Both images pass the second difference along both axes (Immerkaer 1996), whose response peaks there. The
//! smaller of a block's two energies is the noise. Blocks of several brightnesses separate shot noise from the constant
//! part. Cost: nine additions per pixel and image.

use ndarray::ArrayView2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const BLOCK_PX: usize = 16;
/// Sum of the squared taps of the second difference along both axes.
const GAIN: f64 = 36.0;
/// Mean of the smaller of two independent estimates of a variance from a block's pixels, relative to the variance. The
/// estimates scatter by about 12 %; the expected minimum is 0.56 of that lower.
const SMALLER_OF_TWO: f64 = 0.93;

/// Variance of a pixel's noise, in the images' units: `constant + per_unit x value`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PairNoise {
    /// Of a black pixel: read noise and quantisation.
    pub constant: f64,
    /// Shot noise; 0 if the images have too little contrast in brightness to separate it.
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

/// The noise of a pair of one size; pixels without a value (NaN) are ignored. `None` without a complete block.
pub fn of_pair(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Option<PairNoise> {
    let (height, width) = far.dim();
    let [rows, columns] = [height, width].map(|n| n.saturating_sub(2) / BLOCK_PX);
    let [far, near] = [&far, &near].map(|image| image.as_standard_layout());
    let of_row = |row: usize| {
        let [far, near] = [&far, &near].map(|image| energies(&image.view(), row * BLOCK_PX, columns));
        far.into_iter().zip(near).filter_map(|(a, b)| {
            let (variance, brightness) = (a[0].min(b[0]) / SMALLER_OF_TWO, 0.5 * (a[1] + b[1]));
            (variance.is_finite() && brightness.is_finite()).then_some([brightness, variance])
        })
    };
    let mut blocks: Vec<[f64; 2]> = (0..rows).into_par_iter().flat_map_iter(of_row).collect();
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
    // Medians of the darkest and of the brightest quarter determine the line.
    let quarter = (blocks.len() / 4).max(1);
    let [dark, bright] = [&blocks[..quarter], &blocks[blocks.len() - quarter..]];
    let [from, to] = [dark, bright].map(|part| [median(part, 0), median(part, 1)]);
    let slope = (to[1] - from[1]) / (to[0] - from[0]);
    let tells = to[0] - from[0] > 0.1 * to[0].abs() && slope.is_finite() && slope > 0.0;
    let per_unit = if tells { slope } else { 0.0 };
    let constant = if tells { from[1] - slope * from[0] } else { mean_variance };
    Some(PairNoise { constant, per_unit, mean_variance })
}

/// Noise variance and mean brightness of each block of a row.
fn energies(image: &ArrayView2<f32>, top: usize, columns: usize) -> Vec<[f64; 2]> {
    let pixels = (BLOCK_PX * BLOCK_PX) as f64;
    let mut sums = vec![[0.0_f64; 2]; columns];
    for y in top + 1..=top + BLOCK_PX {
        let rows = [y - 1, y, y + 1].map(|y| image.row(y).to_slice());
        let [Some(above), Some(here), Some(below)] = rows else { unreachable!("made in standard layout") };
        for (column, sums) in sums.iter_mut().enumerate() {
            const SEEN_PX: usize = BLOCK_PX + 2;
            let seen = [above, here, below].map(|row| &row[column * BLOCK_PX..column * BLOCK_PX + SEEN_PX]);
            let down: [f32; SEEN_PX] = std::array::from_fn(|x| seen[0][x] - 2.0 * seen[1][x] + seen[2][x]);
            // Eight parallel sums, which the compiler vectorises.
            let (mut squares, mut brightness) = ([0.0_f32; 8], [0.0_f32; 8]);
            for x in 0..BLOCK_PX {
                let second = down[x] - 2.0 * down[x + 1] + down[x + 2];
                squares[x % 8] += second * second;
                brightness[x % 8] += seen[1][x + 1];
            }
            sums[0] += f64::from(squares.iter().sum::<f32>());
            sums[1] += f64::from(brightness.iter().sum::<f32>());
        }
    }
    sums.into_iter().map(|[squares, sum]| [squares / pixels / GAIN, sum / pixels]).collect()
}
