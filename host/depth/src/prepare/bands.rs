//! Bands of brightness across one image: a rolling shutter under a lamp that flickers.
//!
//! Defocus keeps the light of a row but for what crosses into the next rows. So a ratio of both images' rows on which all
//! parts of the rows agree is not of the scene, unless it follows the second difference of the rows' brightness
//! (diffusion: rows of a ruled target). Cost: one pass over both images, of some 800,000 px at most.

use ndarray::{ArrayView2, ArrayViewMut2, Axis};
use rayon::prelude::*;

/// Parts of a row that must agree.
const PARTS: usize = 8;
const LEAST_PART_PX: usize = 16;
/// SD of the Gaussian over the rows, px: larger than the blur, smaller than a band.
const SMOOTHING_PX: f64 = 6.0;
/// Degree of the polynomial along the rows that is left to the field's gain.
const DEGREE: i32 = 4;
/// Variance of a band over that of the mean of the parts.
const CONSISTENT: f64 = 9.0;
/// Largest difference of both images' variance of blur, px^2, and part of the variance that diffusion may not explain.
const DIFFUSION_PX2: f64 = 25.0;
const NOT_DIFFUSION: f64 = 0.7;

/// Brightness of the near image's rows relative to the far one's, around 1.
pub(super) struct Bands {
    factors: Vec<f32>,
    /// Its largest deviation from 1.
    pub amplitude: f64,
}

impl Bands {
    /// Finds bands along the rows with an RMS of more than `least`; `None` without.
    pub fn measure(far: ArrayView2<f32>, near: ArrayView2<f32>, least: f64) -> Option<Self> {
        let (height, width) = far.dim();
        let part = width / PARTS;
        if part < LEAST_PART_PX || height < 8 * SMOOTHING_PX as usize {
            return None;
        }
        let sums: Vec<[[f64; 2]; PARTS]> = far
            .axis_iter(Axis(0))
            .into_par_iter()
            .zip(near.axis_iter(Axis(0)))
            .map(|(far, near)| {
                let mut sums = [[0.0; 2]; PARTS];
                for (index, (far, near)) in far.iter().zip(near).enumerate() {
                    if far.is_finite() && near.is_finite() {
                        let [of_far, of_near] = &mut sums[(index / part).min(PARTS - 1)];
                        *of_far += f64::from(*far);
                        *of_near += f64::from(*near);
                    }
                }
                sums
            })
            .collect();
        let of_image = |part: usize, image: usize| -> Vec<f64> {
            smoothed(&sums.iter().map(|row| row[part][image]).collect::<Vec<f64>>())
        };
        let images: Vec<[Vec<f64>; 2]> =
            (0..PARTS).map(|part| [of_image(part, 0), of_image(part, 1)]).collect();
        if images.iter().flatten().flatten().any(|sum| *sum <= 0.0) {
            return None;
        }
        let ratios: Vec<Vec<f64>> = images
            .iter()
            .map(|[far, near]| {
                without_trend(
                    &far.iter().zip(near).map(|(far, near)| (near / far).ln()).collect::<Vec<f64>>(),
                )
            })
            .collect::<Option<_>>()?;
        let of_row = |row: usize| ratios.iter().map(move |ratio| ratio[row]);
        let mean: Vec<f64> = (0..height).map(|row| of_row(row).sum::<f64>() / PARTS as f64).collect();
        let scatter: f64 = (0..height)
            .map(|row| of_row(row).map(|ratio| (ratio - mean[row]).powi(2)).sum::<f64>() / (PARTS - 1) as f64)
            .sum();
        let signal: f64 = mean.iter().map(|mean| mean * mean).sum();
        let is_common = signal > CONSISTENT * scatter / PARTS as f64;
        if !is_common || (signal / height as f64).sqrt() < least {
            return None;
        }
        let brightness: Vec<f64> = (0..height)
            .map(|row| images.iter().flatten().map(|image| image[row]).sum::<f64>().ln())
            .collect();
        let curvature = |row: usize| match row {
            0 => 0.0,
            row => brightness
                .get(row + 1)
                .map_or(0.0, |below| brightness[row - 1] - 2.0 * brightness[row] + below),
        };
        let (along, all) = mean.iter().enumerate().fold((0.0, 0.0), |(along, all), (row, mean)| {
            (along + mean * curvature(row), all + curvature(row).powi(2))
        });
        let diffusion = if all > 0.0 { (along / all).clamp(-DIFFUSION_PX2, DIFFUSION_PX2) } else { 0.0 };
        let left: f64 =
            mean.iter().enumerate().map(|(row, mean)| (mean - diffusion * curvature(row)).powi(2)).sum();
        (left > NOT_DIFFUSION * signal).then(|| Self {
            amplitude: mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs())),
            factors: mean.iter().map(|mean| mean.exp() as f32).collect(),
        })
    }

    /// Divides the rows of the near image, of which `scale` are one of the measured image.
    pub fn divide(&self, mut near: ArrayViewMut2<f32>, scale: usize) {
        let last = self.factors.len() - 1;
        let factor = |row: usize| {
            let at = ((row as f32 + 0.5) / scale as f32 - 0.5).clamp(0.0, last as f32);
            let (above, below) = (self.factors[at as usize], self.factors[(at as usize + 1).min(last)]);
            above + (below - above) * at.fract()
        };
        near.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(row, mut values)| {
            let factor = factor(row);
            values.mapv_inplace(|value| value / factor);
        });
    }
}

/// Sums over rows under a Gaussian, the ends reflected; ratios need no norm.
fn smoothed(rows: &[f64]) -> Vec<f64> {
    let reach = (3.0 * SMOOTHING_PX) as usize;
    let weight = |off: usize| (-0.5 * (off as f64 / SMOOTHING_PX).powi(2)).exp();
    let weights: Vec<f64> = (0..=reach).map(weight).collect();
    let last = rows.len() - 1;
    let sum = |row: usize| -> f64 {
        let of_both_sides = |off: usize| {
            let above = row.abs_diff(off);
            let below = last - last.abs_diff(row + off);
            weights[off] * (rows[above] + rows[below])
        };
        weights[0] * rows[row] + (1..=reach).map(of_both_sides).sum::<f64>()
    };
    (0..rows.len()).map(sum).collect()
}

/// What a polynomial along the rows leaves.
fn without_trend(values: &[f64]) -> Option<Vec<f64>> {
    let at = |row: usize| 2.0 * row as f64 / values.len() as f64 - 1.0;
    let terms = DEGREE as usize + 1;
    let design = nalgebra::DMatrix::from_fn(values.len(), terms, |row, power| at(row).powi(power as i32));
    let target = nalgebra::DVector::from_column_slice(values);
    let coefficients = crate::operators::least_squares::solve(design.clone(), target.clone()).ok()?;
    Some((target - design * coefficients).iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const LEAST: f64 = 0.005;

    /// Blurs along the rows and columns by a Gaussian of this SD.
    fn blurred(image: &Array2<f32>, sd: f64) -> Array2<f32> {
        let along = |image: &Array2<f32>, axis: Axis| {
            let mut out = image.clone();
            for mut lane in out.lanes_mut(axis) {
                let old: Vec<f32> = lane.to_vec();
                for (at, value) in lane.iter_mut().enumerate() {
                    let (mut sum, mut all) = (0.0, 0.0);
                    for off in -9_i32..=9 {
                        let weight = (-0.5 * (f64::from(off) / sd).powi(2)).exp() as f32;
                        let from = (at as i32 + off).rem_euclid(old.len() as i32) as usize;
                        (sum, all) = (sum + weight * old[from], all + weight);
                    }
                    *value = sum / all;
                }
            }
            out
        };
        along(&along(image, Axis(0)), Axis(1))
    }

    fn pair(scene: &Array2<f32>) -> [Array2<f32>; 2] {
        [blurred(scene, 0.8), blurred(scene, 2.2)]
    }

    fn texture() -> Array2<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        Array2::from_shape_simple_fn((480, 320), || 40.0 + 160.0 * rng.random::<f32>())
    }

    fn band(row: usize) -> f64 {
        1.0 + 0.05 * (std::f64::consts::TAU * row as f64 / 80.0).sin()
    }

    #[test]
    fn bands_are_measured_and_divided_out() {
        let [far, mut near] = pair(&texture());
        let plain = near.clone();
        for (row, mut values) in near.axis_iter_mut(Axis(0)).enumerate() {
            values.mapv_inplace(|value| value * band(row) as f32);
        }
        let found = Bands::measure(far.view(), near.view(), LEAST).expect("bands");
        // The smoothing takes a tenth of a band of 80 rows; a polynomial, which the field's gain has, some of the rest.
        assert!((0.04..0.055).contains(&found.amplitude), "{}", found.amplitude);
        found.divide(near.view_mut(), 1);
        let off = near.iter().zip(&plain).map(|(a, b)| f64::from((a / b - 1.0).powi(2))).sum::<f64>()
            / near.len() as f64;
        assert!(off.sqrt() < 0.01, "{}", off.sqrt());
        // In an image of twice the size each row has two, around its place.
        let mut twice = Array2::from_elem((960, 1), 1.0);
        found.divide(twice.view_mut(), 2);
        for (row, factor) in found.factors.iter().enumerate() {
            let both = 0.5 * (twice[[2 * row, 0]] + twice[[2 * row + 1, 0]]);
            assert!((both * factor - 1.0).abs() < 1e-3, "{row}: {both} {factor}");
        }
    }

    #[test]
    fn neither_texture_nor_a_ruled_target_has_bands() {
        for period in [6, 12, 24, 48] {
            let ruled =
                Array2::from_shape_fn(
                    (240, 320),
                    |(row, _)| if row % period < period / 2 { 50.0 } else { 200.0 },
                );
            let [far, near] = pair(&ruled);
            assert!(Bands::measure(far.view(), near.view(), LEAST).is_none(), "{period}");
        }
        let [far, near] = pair(&texture());
        assert!(Bands::measure(far.view(), near.view(), LEAST).is_none());
    }
}
