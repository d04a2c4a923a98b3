//! The noise of a pair, from the pair itself.
//!
//! Both images pass the second difference along both axes (Immerkaer 1996), whose response peaks at the highest
//! frequencies, towards (pi, pi). There defocus leaves little signal, proportional in both images. So the smaller
//! eigenvalue of a block's covariance is the noise. Blocks of several brightnesses separate shot noise from the constant
//! part. Cost: twenty additions per pixel.

use ndarray::ArrayView2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const BLOCK_PX: usize = 16;
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
            ..self
        }
    }

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
        let of_blocks = energies([far.view(), near.view()], row * BLOCK_PX, columns);
        of_blocks.into_iter().filter_map(|([of_far, of_near, of_both], brightness)| {
            let apart = (0.5 * (of_far - of_near)).hypot(of_both);
            let variance = (0.5 * (of_far + of_near) - apart) / SMALLER;
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
    Some(PairNoise { constant, per_unit, mean_variance, coding: 0.0 })
}

/// Variance of the far image, of the near one, their covariance, and the mean brightness, of each block of a row.
fn energies(images: [ArrayView2<f32>; 2], top: usize, columns: usize) -> Vec<([f64; 3], f64)> {
    const SEEN_PX: usize = BLOCK_PX + 2;
    let pixels = (BLOCK_PX * BLOCK_PX) as f64;
    let mut sums = vec![([0.0_f64; 3], 0.0_f64); columns];
    for y in top + 1..=top + BLOCK_PX {
        let rows = images.each_ref().map(|image| {
            [y - 1, y, y + 1].map(|y| image.row(y).to_slice().expect("made in standard layout"))
        });
        for (column, (energy, brightness)) in sums.iter_mut().enumerate() {
            let seen = |row: &&'_ [f32]| -> [f32; SEEN_PX] {
                let from = &row[column * BLOCK_PX..column * BLOCK_PX + SEEN_PX];
                std::array::from_fn(|x| from[x])
            };
            let [far, near] = rows.each_ref().map(|rows| rows.each_ref().map(seen));
            let down = |[above, here, below]: &[[f32; SEEN_PX]; 3]| -> [f32; SEEN_PX] {
                std::array::from_fn(|x| above[x] - 2.0 * here[x] + below[x])
            };
            let down = [down(&far), down(&near)];
            // Eight parallel sums, which the compiler vectorises.
            let (mut products, mut bright) = ([[0.0_f32; 8]; 3], [0.0_f32; 8]);
            for x in 0..BLOCK_PX {
                let [of_far, of_near] = down.each_ref().map(|down| down[x] - 2.0 * down[x + 1] + down[x + 2]);
                products[0][x % 8] += of_far * of_far;
                products[1][x % 8] += of_near * of_near;
                products[2][x % 8] += of_far * of_near;
                bright[x % 8] += 0.5 * (far[1][x + 1] + near[1][x + 1]);
            }
            for (sum, products) in energy.iter_mut().zip(&products) {
                *sum += f64::from(products.iter().sum::<f32>()) / pixels / GAIN;
            }
            *brightness += f64::from(bright.iter().sum::<f32>()) / pixels;
        }
    }
    sums
}
