//! The noise of a pair, from the pair itself.
//!
//! Both images pass the second difference along both axes (Immerkaer 1996), whose response peaks at the highest
//! frequencies, towards (pi, pi). There defocus leaves little signal, proportional in both images. So the smaller
//! eigenvalue of a block's covariance is the noise. Blocks of several brightnesses separate shot noise from the constant
//! part. Cost: twenty additions per pixel of the blocks.

use ndarray::ArrayView2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::median::median;
use crate::simd::{self, Backend};

const BLOCK_PX: usize = 16;
/// Medians of this number of blocks are exact to 0.3 %.
const ENOUGH: usize = 10_000;
/// Sum of the squared taps of the second difference along both axes.
const GAIN: f64 = 36.0;
/// Mean of a block's smaller eigenvalue relative to the variance, for noise alone: the estimates scatter by about 12 %.
const SMALLER: f64 = 0.92;
/// Rounding of the finest frequencies relative to that of the ones that depth uses (T.81, table K.1).
const HIDDEN: f64 = 20.0;
/// Part of the hidden noise that counts as an error of the coding: detail is rounded away with it.
const DETAIL: f64 = 0.2;
/// Standard deviation of a camera's noise relative to the brightness, where nothing measures it.
const USUAL_NOISE: f64 = 0.015;

/// Variance of a pixel's noise, in the images' units: `constant + per_unit x value`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PairNoise {
    /// Of a black pixel: read noise and quantisation.
    pub constant: f64,
    /// Shot noise; 0 if the images have too little contrast in brightness to separate it.
    pub per_unit: f64,
    /// Mean over the image.
    pub mean_variance: f64,
    /// The part of `constant` that lossy compression made.
    #[serde(default)]
    pub coding: f64,
    /// The part of `constant` that [`Self::coded`] added. It has other frequencies than noise of single pixels.
    #[serde(default)]
    pub added: f64,
}

impl PairNoise {
    /// Adds the error of a lossy coding of variance `coding`, of images with this mean `brightness`. The same
    /// rounding removes fine noise, from which [`of_pair`] would measure that of the camera.
    #[must_use]
    pub fn coded(self, coding: f64, brightness: f64) -> Self {
        if coding <= 0.0 || self.coding > 0.0 {
            return self;
        }
        let hidden = (HIDDEN * coding).min((USUAL_NOISE * brightness).powi(2));
        let added = coding + (hidden - self.mean_variance).max(0.0);
        Self {
            constant: self.constant + added,
            mean_variance: self.mean_variance + added,
            coding: coding + DETAIL * hidden,
            added,
            ..self
        }
    }

    /// Noise of `factor` times the variance.
    #[must_use]
    pub(crate) fn scaled(self, factor: f64) -> Self {
        let [constant, per_unit, mean_variance, coding, added] =
            [self.constant, self.per_unit, self.mean_variance, self.coding, self.added]
                .map(|part| part * factor);
        Self { constant, per_unit, mean_variance, coding, added }
    }

    /// Variance at a brightness.
    pub fn variance(&self, brightness: f64) -> f64 {
        (self.constant + self.per_unit * brightness).max(0.1 * self.mean_variance).max(f64::MIN_POSITIVE)
    }
}

/// The noise of a pair of one size, from at most some 10,000 blocks in rows spread over it; pixels without a value
/// (NaN) are ignored. `None` without a complete block.
pub fn of_pair(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Option<PairNoise> {
    let (height, width) = far.dim();
    let [rows, columns] = [height, width].map(|n| n.saturating_sub(2) / BLOCK_PX);
    let step = (rows * columns).div_ceil(ENOUGH).max(1);
    let [far, near] = [&far, &near].map(|image| image.as_standard_layout());
    let of_row = |index: usize| {
        let of_blocks = energies([far.view(), near.view()], index * step * BLOCK_PX, columns);
        of_blocks.into_iter().filter_map(|[of_far, of_near, of_both, brightness]| {
            let apart = (0.5 * (of_far - of_near)).hypot(of_both);
            let variance = (0.5 * (of_far + of_near) - apart) / SMALLER;
            (variance.is_finite() && brightness.is_finite()).then_some([brightness, variance])
        })
    };
    let mut blocks: Vec<[f64; 2]> = (0..rows.div_ceil(step)).into_par_iter().flat_map_iter(of_row).collect();
    if blocks.is_empty() {
        return None;
    }
    blocks.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    // There are blocks.
    let median = |part: &[[f64; 2]], which: usize| {
        median(part.iter().map(|block| block[which]).collect(), f64::total_cmp).unwrap_or_default()
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
    Some(PairNoise { constant, per_unit, mean_variance, ..PairNoise::default() })
}

/// Variance of the far image, of the near one, their covariance, and the mean brightness, of each block of a row.
fn energies(images: [ArrayView2<f32>; 2], top: usize, columns: usize) -> Vec<[f64; 4]> {
    let width = columns * BLOCK_PX;
    let mut of_columns = [(); 4].map(|()| vec![0.0; width]);
    for y in top..top + BLOCK_PX {
        let rows = images.each_ref().map(|image| {
            [y, y + 1, y + 2].map(|y| image.row(y).to_slice().expect("made in standard layout"))
        });
        simd::add_energies(Backend::best(), rows, of_columns.each_mut().map(|sums| &mut sums[..]));
    }
    let pixels = (BLOCK_PX * BLOCK_PX) as f64;
    let of_block = |block: usize| {
        let sums =
            of_columns.each_ref().map(|of_columns| simd::sum(&of_columns[block..block + BLOCK_PX]) / pixels);
        let [of_far, of_near, of_both, brightness] = sums;
        [of_far / GAIN, of_near / GAIN, of_both / GAIN, brightness]
    };
    (0..width).step_by(BLOCK_PX).map(of_block).collect()
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    /// Fewer blocks than [`ENOUGH`], and more. Without texture the median of the smaller eigenvalues is 0.855 of the
    /// variance (numpy, 15,625 blocks of uniform noise): 0.93 of what [`SMALLER`] expects of them.
    #[test]
    fn noise_is_found_at_any_size() {
        let uniform = |seed: usize, y: usize, x: usize| {
            let mut h = (y * 4096 + x + (seed << 40)) as u64;
            h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((h ^ (h >> 31)) >> 40) as f32 / 16_777_216.0
        };
        for (height, width) in [(1000, 1000), (2100, 2050)] {
            let [far, near] = [1, 2].map(|seed| {
                Array2::from_shape_fn((height, width), |(y, x)| 0.2 + 0.02 * uniform(seed, y, x))
            });
            let expected = 0.93 * 0.02_f64.powi(2) / 12.0;
            let found = of_pair(far.view(), near.view()).unwrap().mean_variance;
            // Four standard errors of the median of 3,844 blocks.
            assert!((found / expected - 1.0).abs() < 0.01, "{height} x {width}: {found} of {expected}");
        }
    }
}
