//! Embedding of new silhouettes by Gaussian radial basis functions with a ridge (Li 2014, eq. 9.3 to 9.7). `y
//! = sum_m w_m exp(-gamma |x - c_m|^2)`, `W = (B + ridge I)^-1 Y`. gamma is 0.03 to 0.1 for centroid
//! distances in [0, 0.7] (the thesis' 1e-4 is for pixels). Training is O(N^3 / 3). Embedding is one pass over
//! the centres in 16-bit fixed point: about 15 us for 1500 x 360, error far below 1e-3.

use super::{EmbeddingError, check, squared_distance, squared_norms, times_transposed};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2};
use rayon::prelude::*;

/// Fixed-point scale. Squares of a run of [`RUN`] differences fit an i32 (64 x (3990 x 1.45)^2 < 2^31).
const SCALE: f32 = 3990.0;
const LARGEST: f32 = 1.45;
/// Differences summed as integers before conversion to float.
const RUN: usize = 64;

/// A trained map from samples to embedded points.
#[derive(Clone, Debug, PartialEq)]
pub struct Rbf {
    /// Gallery samples (M x d).
    pub centres: Array2<f32>,
    /// Weights of centres (M x D).
    pub weights: Array2<f32>,
    /// Coefficient of the squared distance.
    pub gamma: f32,
    /// Ridge used in training.
    pub ridge: f64,
    /// Condition number of the system, by power iteration.
    pub condition: f64,
    /// Centres in 16-bit fixed point, if they fit.
    fixed: Option<Vec<[i16; RUN]>>,
    /// Weights by dimension, so that each is a dot product.
    by_dimension: Array2<f32>,
}

impl Rbf {
    /// Learns `samples` (N x d) to `coordinates` (N x D); fails for non-finite samples or a singular system.
    pub fn train(
        samples: ArrayView2<f32>,
        coordinates: ArrayView2<f32>,
        gamma: f32,
        ridge: f64,
    ) -> Result<Self, EmbeddingError> {
        check(samples, 2)?;
        check(coordinates, 0)?;
        for (name, value) in [("gamma", f64::from(gamma)), ("ridge", ridge)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(EmbeddingError::Parameter { name, value });
            }
        }
        if coordinates.nrows() != samples.nrows() {
            return Err(EmbeddingError::Shape {
                what: "rows of the coordinates",
                expected: samples.nrows(),
                found: coordinates.nrows(),
            });
        }
        let kernel = kernel(samples, gamma);
        let n = samples.nrows();
        let system =
            Mat::<f64>::from_fn(n, n, |i, j| f64::from(kernel[[i, j]]) + if i == j { ridge } else { 0.0 });
        let factor = system.llt(Side::Lower).map_err(|_| EmbeddingError::Singular { ridge })?;
        let targets = Mat::<f64>::from_fn(n, coordinates.ncols(), |i, k| f64::from(coordinates[[i, k]]));
        let solved = factor.solve(&targets);
        let weights = Array2::from_shape_fn(coordinates.dim(), |(i, k)| solved[(i, k)] as f32);
        if weights.iter().any(|w| !w.is_finite()) {
            return Err(EmbeddingError::Singular { ridge });
        }
        let condition = largest(n, |v| &system * v) * largest(n, |v| factor.solve(v));
        Ok(Self::assemble(samples.to_owned(), weights, gamma, ridge, condition))
    }

    /// A map from its parts, as read from a model.
    pub fn assemble(
        centres: Array2<f32>,
        weights: Array2<f32>,
        gamma: f32,
        ridge: f64,
        condition: f64,
    ) -> Self {
        let centres = centres.as_standard_layout().into_owned();
        let fits = centres.iter().all(|v| (0.0..=LARGEST).contains(v));
        let fixed = fits.then(|| centres.rows().into_iter().flat_map(quantised).collect());
        let by_dimension = weights.t().as_standard_layout().to_owned();
        Self { centres, weights, gamma, ridge, condition, fixed, by_dimension }
    }

    pub fn dimensions(&self) -> usize {
        self.weights.ncols()
    }

    /// Embeds one sample (d) to D coordinates; fails for another width.
    pub fn embed(&self, sample: ArrayView1<f32>) -> Result<Array1<f32>, EmbeddingError> {
        if sample.len() != self.centres.ncols() {
            return Err(EmbeddingError::Shape {
                what: "width of the sample",
                expected: self.centres.ncols(),
                found: sample.len(),
            });
        }
        let mut basis = self.squared_distances(sample);
        pulp::Arch::new().dispatch(|| {
            for value in &mut basis {
                *value = exp_negative(self.gamma * *value);
            }
        });
        let mut out = Array1::zeros(self.weights.ncols());
        pulp::Arch::new().dispatch(|| {
            for (out, weights) in out.iter_mut().zip(self.by_dimension.rows()) {
                *out = weights.as_slice().map_or(0.0, |weights| dot(weights, &basis));
            }
        });
        Ok(out)
    }

    /// Embeds samples (N x d) to N x D coordinates on the current rayon pool; fails for another width or values that are
    /// not finite.
    pub fn embed_all(&self, samples: ArrayView2<f32>) -> Result<Array2<f32>, EmbeddingError> {
        check(samples, 0)?;
        let rows: Result<Vec<Array1<f32>>, EmbeddingError> =
            samples.outer_iter().into_par_iter().map(|row| self.embed(row)).collect();
        let mut out = Array2::zeros((samples.nrows(), self.dimensions()));
        for (mut to, from) in out.rows_mut().into_iter().zip(rows?) {
            to.assign(&from);
        }
        Ok(out)
    }

    fn squared_distances(&self, sample: ArrayView1<f32>) -> Vec<f32> {
        match &self.fixed {
            Some(fixed) if sample.iter().all(|v| (0.0..=LARGEST).contains(v)) => {
                let x: Vec<[i16; RUN]> = quantised(sample).collect();
                let mut squared = vec![0.0_f32; self.centres.nrows()];
                pulp::Arch::new().dispatch(|| {
                    for (out, centre) in squared.iter_mut().zip(fixed.chunks_exact(x.len())) {
                        let sum: f32 = x.iter().zip(centre).map(|(a, b)| run_of_squares(a, b) as f32).sum();
                        *out = sum * (1.0 / (SCALE * SCALE));
                    }
                });
                squared
            }
            _ => {
                let x = sample.as_standard_layout();
                let mut squared = vec![0.0_f32; self.centres.nrows()];
                if let (Some(x), Some(centres)) = (x.as_slice(), self.centres.as_slice()) {
                    pulp::Arch::new().dispatch(|| {
                        for (out, centre) in squared.iter_mut().zip(centres.chunks_exact(x.len().max(1))) {
                            *out = squared_distance(x, centre);
                        }
                    });
                }
                squared
            }
        }
    }
}

fn quantised(sample: ArrayView1<f32>) -> impl Iterator<Item = [i16; RUN]> {
    let runs = sample.len().div_ceil(RUN);
    let values: Vec<i16> = sample.iter().map(|v| (v * SCALE).round() as i16).collect();
    (0..runs).map(move |r| std::array::from_fn(|k| values.get(r * RUN + k).copied().unwrap_or(0)))
}

#[inline(always)]
fn run_of_squares(a: &[i16; RUN], b: &[i16; RUN]) -> i32 {
    let mut sum = 0;
    for k in 0..RUN {
        let difference = i32::from(a[k].wrapping_sub(b[k]));
        sum += difference * difference;
    }
    sum
}

/// Eight partial sums, so that it vectorises.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    let tail: f32 =
        a.chunks_exact(8).remainder().iter().zip(b.chunks_exact(8).remainder()).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + tail
}

fn kernel(samples: ArrayView2<f32>, gamma: f32) -> Array2<f32> {
    let norms = squared_norms(samples);
    let mut kernel = times_transposed(samples, samples);
    let n = samples.nrows();
    if let Some(values) = kernel.as_slice_mut() {
        values.par_chunks_mut(n).zip(&norms).for_each(|(row, norm)| {
            pulp::Arch::new().dispatch(|| {
                for (value, other) in row.iter_mut().zip(&norms) {
                    *value = exp_negative(gamma * (norm + other - 2.0 * *value).max(0.0));
                }
            });
        });
    }
    kernel
}

/// `exp(-x)` for x >= 0 within 2e-5 relative, vectorisable: 2^(-x log2 e) from exponent bits and a series.
#[inline(always)]
pub(crate) fn exp_negative(x: f32) -> f32 {
    // Cut at 2^-125, below which results are denormal.
    let t = (-x * std::f32::consts::LOG2_E).clamp(-125.0, 0.0);
    let whole = t.floor();
    let part = t - whole;
    // Taylor coefficients of 2^p about 0 with p in [0, 1): ln(2)^k / k!.
    const C: [f32; 6] =
        [std::f32::consts::LN_2, 0.240_226_5, 0.055_504_1, 0.009_618_13, 0.001_333_36, 0.000_154_035];
    let polynomial =
        1.0 + part * (C[0] + part * (C[1] + part * (C[2] + part * (C[3] + part * (C[4] + part * C[5])))));
    f32::from_bits(((whole as i32 + 127) as u32) << 23) * polynomial
}

fn largest(n: usize, apply: impl Fn(&Mat<f64>) -> Mat<f64>) -> f64 {
    let mut v = Mat::<f64>::from_fn(n, 1, |i, _| 1.0 + 0.5 * ((i as f64) * 0.618_034).fract());
    let mut value = 0.0;
    for _ in 0..12 {
        let norm = v.norm_l2();
        v = apply(&(faer::Scale(1.0 / norm) * &v));
        value = v.norm_l2();
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    fn data(n: usize, d: usize) -> (Array2<f32>, Array2<f32>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        // Smooth curves in [0, 0.7] with two parameters.
        let parameters: Vec<[f32; 2]> =
            (0..n).map(|_| [rng.random_range(0.0..1.0), rng.random_range(0.0..1.0)]).collect();
        let samples = Array2::from_shape_fn((n, d), |(i, j)| {
            let [a, b] = parameters[i];
            0.35 + 0.2 * a * (j as f32 * 0.05).sin() + 0.1 * b * (j as f32 * 0.11).cos()
        });
        let targets = Array2::from_shape_fn((n, 2), |(i, k)| 10.0 * parameters[i][k]);
        (samples, targets)
    }

    #[test]
    fn the_map_meets_its_training_points_and_predicts_between_them() {
        let (samples, targets) = data(400, 360);
        let (train, test) = (samples.slice(ndarray::s![..350, ..]), samples.slice(ndarray::s![350.., ..]));
        let rbf = Rbf::train(train, targets.slice(ndarray::s![..350, ..]), 0.1, 1e-3).expect("solvable");
        assert!(rbf.condition > 1e3 && rbf.condition < 1e8, "{}", rbf.condition);
        let found = rbf.embed_all(test).expect("same width");
        let worst =
            (&found - &targets.slice(ndarray::s![350.., ..])).mapv(f32::abs).fold(0.0_f32, |m, v| m.max(*v));
        assert!(worst < 0.6, "off by {worst} of 10");
    }

    #[test]
    fn the_order_of_samples_in_memory_does_not_matter() {
        let (samples, targets) = data(60, 40);
        // Beyond the fixed point's range.
        let samples = samples * 10.0;
        let by_columns = samples.t().as_standard_layout().into_owned().reversed_axes();
        let map =
            |samples: ArrayView2<f32>| Rbf::train(samples, targets.view(), 0.01, 1e-3).expect("solvable");
        let (rows, columns) = (map(samples.view()), map(by_columns.view()));
        let found = columns.embed_all(by_columns.view()).expect("same width");
        assert_eq!(found, rows.embed_all(samples.view()).expect("same width"));
    }

    #[test]
    fn parameters_and_samples_without_a_meaning_are_refused() {
        let (samples, targets) = data(20, 8);
        for (gamma, ridge) in [(-1.0, 1e-3), (f32::NAN, 1e-3), (0.1, -1.0)] {
            let error = Rbf::train(samples.view(), targets.view(), gamma, ridge).unwrap_err();
            assert!(matches!(error, EmbeddingError::Parameter { .. }), "{error}");
        }
        let rbf = Rbf::train(samples.view(), targets.view(), 0.1, 1e-3).expect("solvable");
        let mut odd = samples;
        odd[(3, 2)] = f32::NAN;
        assert_eq!(rbf.embed_all(odd.view()), Err(EmbeddingError::NotFinite { row: 3 }));
    }

    #[test]
    fn fixed_point_stays_within_a_thousandth_of_the_range() {
        let (samples, targets) = data(300, 360);
        let rbf = Rbf::train(samples.view(), targets.view(), 0.1, 1e-3).expect("solvable");
        let exact = Rbf { fixed: None, ..rbf.clone() };
        assert!(rbf.fixed.is_some());
        for row in samples.rows().into_iter().take(50) {
            let (a, b) = (rbf.embed(row).expect("width"), exact.embed(row).expect("width"));
            assert!((&a - &b).iter().all(|v| v.abs() < 0.01), "{a} {b}");
        }
    }

    #[test]
    fn exp_is_exp() {
        for i in 0..2000 {
            let x = i as f32 * 0.02;
            let exact = f64::from(-x).exp();
            assert!((f64::from(exp_negative(x)) - exact).abs() <= 2e-5 * exact, "{x}");
        }
    }

    #[test]
    fn bad_input_is_named() {
        let (samples, targets) = data(20, 360);
        assert!(Rbf::train(samples.view(), targets.slice(ndarray::s![..10, ..]), 0.1, 1e-3).is_err());
        let mut doubled = samples.clone();
        let first = doubled.row(0).to_owned();
        doubled.row_mut(1).assign(&first);
        let error =
            Rbf::train(doubled.view(), targets.view(), 0.1, 0.0).expect_err("two equal rows, no ridge");
        assert!(matches!(error, EmbeddingError::Singular { .. }));
        let rbf = Rbf::train(samples.view(), targets.view(), 0.1, 1e-3).expect("solvable");
        assert!(rbf.embed(Array1::zeros(12).view()).is_err());
    }
}
