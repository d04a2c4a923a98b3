//! The noise of a pair, from the pair itself.
//!
//! Both images pass the second difference along both axes (Immerkaer 1996), whose response peaks at the highest
//! frequencies, towards (pi, pi). There defocus leaves little signal, proportional in both images. So the smaller
//! eigenvalue of a block's covariance is the noise. Where both images have unlike noise, it is that of the more blurred
//! one, as in the residual of the model, and the smaller one in blocks without detail. Blocks of several brightnesses separate shot noise from the constant part.
//! Cost: twenty additions per pixel of the blocks.

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
    /// rounding removes fine noise, from which that of the camera would be measured.
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

/// What the noise of a pair is measured from: of each block the variance of the far image's highest frequencies, of the near
/// one's, their covariance, and both means.
#[derive(Default)]
pub(crate) struct Blocks(Vec<[f64; 5]>);

impl Blocks {
    /// At most some 10,000 blocks of a pair of one size, in rows spread over it, without those that have pixels without a value
    /// (NaN).
    pub fn of(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Self {
        let (height, width) = far.dim();
        let [rows, columns] = [height, width].map(|n| n.saturating_sub(2) / BLOCK_PX);
        let step = (rows * columns).div_ceil(ENOUGH).max(1);
        let [far, near] = [&far, &near].map(|image| image.as_standard_layout());
        let of_row = |index: usize| {
            let of_blocks = energies([far.view(), near.view()], index * step * BLOCK_PX, columns);
            of_blocks.into_iter().filter(|block| block.iter().all(|value| value.is_finite()))
        };
        Self((0..rows.div_ceil(step)).into_par_iter().flat_map_iter(of_row).collect())
    }

    /// The noise of the pair once the near image is divided by `gain`. `None` without a block.
    pub fn noise(&self, gain: f64) -> Option<PairNoise> {
        let of_block = |&[of_far, of_near, of_both, far, near]: &[f64; 5]| {
            let [of_near, of_both] = [of_near / (gain * gain), of_both / gain];
            let apart = (0.5 * (of_far - of_near)).hypot(of_both);
            [0.5 * (far + near / gain), (0.5 * (of_far + of_near) - apart) / SMALLER]
        };
        let mut blocks: Vec<[f64; 2]> = self.0.iter().map(of_block).collect();
        blocks.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let median = |part: &[[f64; 2]], which: usize| {
            median(part.iter().map(|block| block[which]).collect(), f64::total_cmp)
        };
        let mean_variance = median(&blocks, 1)?;
        // Medians of the darkest and of the brightest quarter determine the line.
        let quarter = (blocks.len() / 4).max(1);
        let [dark, bright] = [&blocks[..quarter], &blocks[blocks.len() - quarter..]];
        let line = |part| Some([median(part, 0)?, median(part, 1)?]);
        let [from, to] = [line(dark)?, line(bright)?];
        let slope = (to[1] - from[1]) / (to[0] - from[0]);
        let tells = to[0] - from[0] > 0.1 * to[0].abs() && slope.is_finite() && slope > 0.0;
        let per_unit = if tells { slope } else { 0.0 };
        let constant = if tells { from[1] - slope * from[0] } else { mean_variance };
        Some(PairNoise { constant, per_unit, mean_variance, ..PairNoise::default() })
    }
}

/// Variance of the far image, of the near one, their covariance, and the mean brightness of both, of each block of a row.
fn energies(images: [ArrayView2<f32>; 2], top: usize, columns: usize) -> Vec<[f64; 5]> {
    let width = columns * BLOCK_PX;
    let mut of_columns = [(); 5].map(|()| vec![0.0; width]);
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
        let [of_far, of_near, of_both, far, near] = sums;
        [of_far / GAIN, of_near / GAIN, of_both / GAIN, far, near]
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
            let blocks = Blocks::of(far.view(), near.view());
            let found = blocks.noise(1.0).unwrap().mean_variance;
            // Four standard errors of the median of 3,844 blocks.
            assert!((found / expected - 1.0).abs() < 0.01, "{height} x {width}: {found} of {expected}");
            // A pair that was scaled and balanced again has the noise of the far image's scale.
            for [of_far, of_near] in [[0.25_f32, 1.0], [1.0, 0.5]] {
                let blocks = Blocks::of((&far * of_far).view(), (&near * of_near).view());
                let scaled = blocks.noise(f64::from(of_near / of_far)).unwrap().mean_variance;
                assert!(
                    (scaled / (f64::from(of_far).powi(2) * found) - 1.0).abs() < 1e-4,
                    "{scaled} of {found}"
                );
            }
        }
    }
}
