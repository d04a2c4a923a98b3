//! Relative brightness of a pair's images: one gain, or one that varies slowly over the field.
//!
//! Defocus preserves light, so means over blocks far larger than the blur are alike in both images. Their ratio is
//! exposure, lamp, aperture and vignetting. A polynomial of fourth degree over the field, which follows vignetting
//! (`r^2` and `r^4` about any centre), is fitted; Huber's weights suppress blocks with motion or much light spread
//! across the border. Cost: one pass over both images for the means; one division or multiplication and a Horner sum per pixel to
//! apply.

use nalgebra::{DMatrix, DVector};
use ndarray::{ArrayView2, ArrayViewMut2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::median::deviation;
use crate::operators::least_squares;
use crate::simd::{self, Backend};

/// Blocks along the shorter side.
const BLOCKS: usize = 24;
/// Shortest side of a block, px: far larger than the blur.
const LEAST_BLOCK_PX: usize = 12;
/// Degree of the polynomial.
const DEGREE: usize = 4;
const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;
/// Rounds of reweighting.
const ROUNDS: usize = 5;

/// Brightness of the near image relative to the far one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Its mean over the field.
    pub mean: f64,
    /// Smallest and largest over the field.
    pub range: [f64; 2],
    /// Standard error of the mean.
    pub standard_error: f64,
    /// RMS of the blocks' ratios after division by the mean alone, and after division by the polynomial.
    pub left_over: [f64; 2],
    /// Number of compared blocks.
    pub blocks: usize,
    polynomial: Polynomial,
}

/// Coefficients of x^i y^j with i + j <= [`DEGREE`], x and y from -1 to 1 along the longer side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Polynomial {
    /// Whether the value is the near image's brightness over the far one's, or its reciprocal. Which of them is closer
    /// to a polynomial depends on which image is vignetted.
    reciprocal: bool,
    coefficients: Vec<f64>,
}

fn exponents() -> impl Iterator<Item = (i32, i32)> {
    (0..=DEGREE as i32).flat_map(|i| (0..=DEGREE as i32 - i).map(move |j| (i, j)))
}

/// Field coordinates of a place.
fn field([x, y]: [f64; 2], (height, width): (usize, usize)) -> [f64; 2] {
    let half = 0.5 * height.max(width) as f64;
    [(x + 0.5 - 0.5 * width as f64) / half, (y + 0.5 - 0.5 * height as f64) / half]
}

/// Middle in field coordinates, and the mean of both images.
struct Block {
    at: [f64; 2],
    far: f64,
    near: f64,
}

impl Gain {
    /// Measures the gain of an aligned pair; pixels without a value (NaN) in either image are ignored. `None` for
    /// images around 0, like differences, and for fewer blocks than terms.
    pub fn measure(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Option<Self> {
        let blocks = blocks(far, near);
        if blocks.len() < 2 * TERMS || blocks.iter().any(|block| block.far <= 0.0 || block.near <= 0.0) {
            return None;
        }
        // Brighter blocks are more certain: noise and light from across the border weigh less.
        let weights: Vec<f64> = blocks.iter().map(|block| block.far * block.near).collect();
        let ratios: Vec<f64> = blocks.iter().map(|block| block.near / block.far).collect();
        let flat = Fit::new(std::slice::from_ref(&ratios), &weights, &[vec![1.0; blocks.len()]])?;
        let term = |(i, j)| blocks.iter().map(|block| block.at[0].powi(i) * block.at[1].powi(j)).collect();
        let terms: Vec<Vec<f64>> = exponents().map(term).collect();
        let reciprocals: Vec<f64> = ratios.iter().map(|ratio| ratio.recip()).collect();
        let curved = Fit::new(&[ratios, reciprocals], &weights, &terms)?;
        let polynomial = Polynomial { reciprocal: curved.which == 1, coefficients: curved.coefficients };
        let mean = flat.coefficients[0];
        let values = corners_and_middle(far.dim()).map(|at| polynomial.at(at));
        Some(Self {
            mean,
            range: [values.iter().copied().fold(mean, f64::min), values.iter().copied().fold(mean, f64::max)],
            standard_error: flat.rms / (blocks.len() as f64).sqrt(),
            left_over: [flat.rms / mean, curved.rms / if curved.which == 1 { mean.recip() } else { mean }],
            blocks: blocks.len(),
            polynomial,
        })
    }

    /// Whether the gain varies over the field by more than chance and by more than `least`.
    pub fn varies(&self, least: f64) -> bool {
        let [flat, curved] = self.left_over;
        let explained = (flat * flat - curved * curved).max(0.0);
        let by_chance = curved * curved * TERMS as f64 / self.blocks as f64;
        explained.sqrt() > least && explained > 4.0 * by_chance
    }

    /// Divides an image by the mean gain.
    pub fn divide_by_mean(&self, image: &mut ArrayViewMut2<f32>) {
        let factor = self.mean.recip() as f32;
        image.par_mapv_inplace(|value| value * factor);
    }

    /// Divides an image by the gain at each place.
    pub fn divide_by_field(&self, image: &mut ArrayViewMut2<f32>) {
        let size = image.dim();
        let (backend, reciprocal) = (Backend::best(), self.polynomial.reciprocal);
        image.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(y, mut row)| {
            let [first, v] = field([0.0, y as f64], size);
            let step = field([1.0, 0.0], size)[0] - field([0.0, 0.0], size)[0];
            let of_row = self.polynomial.of_row(v);
            match row.as_slice_mut() {
                Some(row) => simd::divide_by_polynomial(backend, of_row, [first, step], reciprocal, row),
                None => {
                    let mut values = row.to_vec();
                    simd::divide_by_polynomial(backend, of_row, [first, step], reciprocal, &mut values);
                    row.iter_mut().zip(values).for_each(|(to, value)| *to = value);
                }
            }
        });
    }
}

impl Polynomial {
    /// The gain at a place in field coordinates.
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let value: f64 =
            exponents().zip(&self.coefficients).map(|((i, j), c)| c * x.powi(i) * y.powi(j)).sum();
        if self.reciprocal { value.recip() } else { value }
    }

    /// Coefficients of the powers of x along a row.
    fn of_row(&self, y: f64) -> [f32; DEGREE + 1] {
        let mut row = [0.0_f64; DEGREE + 1];
        for ((i, j), c) in exponents().zip(&self.coefficients) {
            row[i as usize] += c * y.powi(j);
        }
        row.map(|c| c as f32)
    }
}

fn corners_and_middle(size: (usize, usize)) -> [[f64; 2]; 5] {
    let (bottom, right) = ((size.0 - 1) as f64, (size.1 - 1) as f64);
    [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom], [0.5 * right, 0.5 * bottom]]
        .map(|at| field(at, size))
}

/// The robust fit with the least relative residual of several targets.
struct Fit {
    which: usize,
    coefficients: Vec<f64>,
    rms: f64,
}

impl Fit {
    /// `terms` and `targets` have a value for each of the blocks that `weights` are of.
    fn new(targets: &[Vec<f64>], weights: &[f64], terms: &[Vec<f64>]) -> Option<Self> {
        let fit = |(which, target): (usize, &Vec<f64>)| {
            let (coefficients, rms) = robust(terms, target, weights)?;
            let mean = target.iter().sum::<f64>() / target.len() as f64;
            Some((rms / mean, Self { which, coefficients, rms }))
        };
        let fits: Vec<_> = targets.par_iter().enumerate().filter_map(fit).collect();
        fits.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, fit)| fit)
    }
}

/// Coefficients and robust RMS residual (1.48 times the median magnitude).
fn robust(terms: &[Vec<f64>], target: &[f64], weights: &[f64]) -> Option<(Vec<f64>, f64)> {
    let mut trust = vec![1.0; target.len()];
    let mut found = (Vec::new(), f64::INFINITY);
    for _ in 0..ROUNDS {
        let weights: Vec<f64> = weights.iter().zip(&trust).map(|(w, t)| w * t).collect();
        let coefficients = weighted(terms, target, &weights)?;
        let mut left = target.to_vec();
        for (term, coefficient) in terms.iter().zip(&coefficients) {
            left.iter_mut().zip(term).for_each(|(left, value)| *left -= coefficient * value);
        }
        let rms = deviation(left.iter().copied())?.max(1e-12);
        // Huber's weights.
        trust = left.iter().map(|l| (1.5 * rms / l.abs().max(1e-300)).min(1.0)).collect();
        found = (coefficients.as_slice().to_vec(), rms);
    }
    Some(found)
}

/// Least squares by the normal equations, which the field's few terms allow; by QR where they are nearly dependent.
fn weighted(terms: &[Vec<f64>], target: &[f64], weights: &[f64]) -> Option<DVector<f64>> {
    const LEAST_PIVOT: f64 = 1e-5;
    let n = terms.len();
    let (mut normal, mut right) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
    for (i, term) in terms.iter().enumerate() {
        let weighed: Vec<f64> = weights.iter().zip(term).map(|(weight, value)| weight * value).collect();
        right[i] = dot(&weighed, target);
        // Cholesky's decomposition reads the lower half.
        for (j, term) in terms.iter().enumerate().skip(i) {
            normal[(j, i)] = dot(&weighed, term);
        }
    }
    let certain = |factor: &nalgebra::Cholesky<f64, nalgebra::Dyn>| {
        let pivots = factor.l_dirty().diagonal();
        pivots.min() > LEAST_PIVOT * pivots.max()
    };
    if let Some(factor) = normal.cholesky().filter(certain) {
        return Some(factor.solve(&right));
    }
    let roots: Vec<f64> = weights.iter().map(|weight| weight.sqrt()).collect();
    let matrix = DMatrix::from_fn(target.len(), n, |i, j| roots[i] * terms[j][i]);
    least_squares::solve(matrix, DVector::from_fn(target.len(), |i, _| roots[i] * target[i])).ok()
}

/// Dot product in eight parallel sums, which the compiler vectorises.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0_f64; 8];
    for (a, b) in a.iter().zip(b) {
        sums.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += a * b);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

/// Sum of a row of a block in eight parallel sums, which the compiler vectorises.
fn sum(row: &[f32]) -> f32 {
    let (parts, rest) = row.as_chunks::<8>();
    let mut sums = [0.0_f32; 8];
    for part in parts {
        sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
    }
    sums.iter().chain(rest).sum()
}

fn blocks(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Vec<Block> {
    let (height, width) = far.dim();
    let side = (height.min(width) / BLOCKS).max(LEAST_BLOCK_PX);
    let of_row = |row: usize| -> Vec<Block> {
        let top = row * side;
        (0..width / side)
            .filter_map(|column| {
                let left = column * side;
                let area = ndarray::s![top..top + side, left..left + side];
                let (mut sums, mut count) = ([0.0_f64; 2], 0_usize);
                for (far, near) in far.slice(area).rows().into_iter().zip(near.slice(area).rows()) {
                    // Without holes, the usual case, both sums are finite and every pixel counts.
                    let whole = [&far, &near].map(|row| row.as_slice().map_or(f32::NAN, sum));
                    if whole.iter().all(|sum| sum.is_finite()) {
                        sums.iter_mut().zip(whole).for_each(|(all, sum)| *all += f64::from(sum));
                        count += side;
                        continue;
                    }
                    for (far, near) in far.iter().zip(near).filter(|(f, n)| f.is_finite() && n.is_finite()) {
                        sums[0] += f64::from(*far);
                        sums[1] += f64::from(*near);
                        count += 1;
                    }
                }
                let half = 0.5 * (side as f64 - 1.0);
                let at = field([left as f64 + half, top as f64 + half], (height, width));
                let [far, near] = sums.map(|sum| sum / count as f64);
                (2 * count > side * side).then_some(Block { at, far, near })
            })
            .collect()
    };
    (0..height / side).into_par_iter().flat_map_iter(of_row).collect()
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn texture(y: usize, x: usize) -> f32 {
        let hash = (y * 7919 + x * 104_729 + y * x * 31) as u32;
        1.0 + 0.4 * ((hash.wrapping_mul(2_654_435_761) >> 16) as f32 / 65_536.0 - 0.5)
    }

    fn pair(gain: impl Fn(f64, f64) -> f64) -> [Array2<f32>; 2] {
        let far = Array2::from_shape_fn((240, 320), |(y, x)| texture(y, x));
        let near = Array2::from_shape_fn((240, 320), |(y, x)| {
            let [u, v] = field([x as f64, y as f64], (240, 320));
            texture(y, x) * gain(u, v) as f32
        });
        [far, near]
    }

    #[test]
    fn one_gain_is_one_gain() {
        let [far, near] = pair(|_, _| 1.2);
        let gain = Gain::measure(far.view(), near.view()).unwrap();
        assert!((gain.mean - 1.2).abs() < 1e-6 && !gain.varies(1e-3), "{gain:?}");
    }

    #[test]
    fn vignetting_of_either_image_is_undone() {
        for of_far in [false, true] {
            let falloff = |u: f64, v: f64| 1.0 - 0.4 * (u * u + v * v) / 1.5625;
            let [far, near] = pair(|u, v| if of_far { falloff(u, v).recip() } else { falloff(u, v) });
            let gain = Gain::measure(far.view(), near.view()).unwrap();
            assert!(gain.varies(1e-3), "{gain:?}");
            let mut mended = near.clone();
            gain.divide_by_field(&mut mended.view_mut());
            let mut by_columns = near.t().to_owned();
            gain.divide_by_field(&mut by_columns.view_mut().reversed_axes());
            assert_eq!(by_columns.t(), mended);
            for (a, b) in mended.iter().zip(&far) {
                assert!((a / b - 1.0).abs() < 2e-3, "{a} {b}");
            }
        }
    }

    #[test]
    fn motion_and_missing_pixels_have_no_influence() {
        let [far, mut near] = pair(|_, _| 0.9);
        near.slice_mut(ndarray::s![60..100, 80..130]).fill(0.2);
        near.slice_mut(ndarray::s![.., 0..9]).fill(f32::NAN);
        let gain = Gain::measure(far.view(), near.view()).unwrap();
        assert!((gain.mean - 0.9).abs() < 2e-3 && !gain.varies(4e-3), "{gain:?}");
    }

    #[test]
    fn images_around_zero_have_no_gain() {
        let [far, near] = pair(|_, _| 1.0).map(|image| image.mapv(|v| v - 1.0));
        assert!(Gain::measure(far.view(), near.view()).is_none());
    }
}
