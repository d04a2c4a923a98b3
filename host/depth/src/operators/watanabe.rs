//! The operators of Watanabe & Nayar (1998), by their procedure.
//!
//! They assume a pill-box and start from `Gp1`, the Laplacian-of-Gaussian band-pass, fitted to the kernel size, with
//! the pre-filter of [`raj`]. `Gm1` and `Gp2` minimise the depth error of a texture of amplitude 1/f by
//! Levenberg-Marquardt: the residual `Gp1 alpha + Gp2 alpha^3 - NIR Gm1` over the slope `Gp1 + 3 Gp2 alpha^2`, weighted
//! with the texture's and the filters' power. (Small slopes are regularised.) Cost: 10 to 100 ms.

use levenberg_marquardt::LevenbergMarquardt;
use nalgebra::{DMatrix, DVector};

use super::minimise::{Misfit, minimise};
use super::samples::{Sample, Samples};
use super::{DesignError, raj};
use crate::kernel::Kernel;
use crate::normalised_ratio::GridPoint;
use crate::psf::Otf;

/// Slope (the band-pass has peak 1) below which it is regularised.
const SLOPE_FLOOR: f64 = 0.05;

const PATIENCE: usize = 40;

/// `[Gm1, Gp1, Gp2]` after Watanabe & Nayar. Returns [`DesignError`] if the start or the minimisation fails.
pub fn design(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let [gm1, gp1, gp2] = raj::design(otf, max_blur_px, prefilter, grid, size)?;
    let samples = Samples::new(otf, max_blur_px, prefilter, grid, &gp1);
    let start = [gm1.octant(), gp2.octant()].concat();
    let search = LevenbergMarquardt::new().with_patience(PATIENCE);
    let taps = minimise(DepthError { samples }, start, &search)?;
    let [gm1, gp2] = Kernel::several(size, &taps)?;
    Ok([gm1, gp1, gp2])
}

/// Residuals for the concatenated taps of Gm1 and Gp2.
struct DepthError {
    samples: Samples,
}

impl DepthError {
    /// Misfit, `s / (s^2 + floor^2)` of the slope `s`, and its derivative by `s`.
    fn parts(&self, taps: &[f64], sample: &Sample) -> [f64; 3] {
        let (gm1, gp2) = taps.split_at(self.samples.taps());
        let [gm1, gp2] = [gm1, gp2].map(|taps| self.samples.response(taps, sample));
        let gp1 = self.samples.gp1[sample.point];
        let misfit = gp1 * sample.alpha + gp2 * sample.alpha.powi(3) - sample.normalised_ratio * gm1;
        let slope = gp1 + 3.0 * gp2 * sample.alpha.powi(2);
        let divisor = slope * slope + SLOPE_FLOOR * SLOPE_FLOOR;
        [misfit, slope / divisor, (SLOPE_FLOOR * SLOPE_FLOOR - slope * slope) / (divisor * divisor)]
    }

    /// The residual of a sample and its derivatives by the responses of Gm1 and Gp2.
    fn row(&self, taps: &[f64], sample: &Sample) -> [f64; 3] {
        let [misfit, inverse, derivative] = self.parts(taps, sample);
        let weight = sample.weight * self.samples.gp1[sample.point];
        let by_gm1 = -weight * sample.normalised_ratio * inverse;
        let by_gp2 =
            weight * (inverse * sample.alpha.powi(3) + misfit * derivative * 3.0 * sample.alpha.powi(2));
        [by_gm1, by_gp2, weight * misfit * inverse]
    }

    /// For each point three rows `[by Gm1, by Gp2, residual]`, the triangular factor of its samples' rows: a rotation
    /// changes neither the sum of squares nor the normal equations.
    fn compressed(&self, taps: &[f64]) -> impl Iterator<Item = (usize, [[f64; 3]; 3])> {
        self.samples.samples.chunk_by(|a, b| a.point == b.point).map(move |samples| {
            let mut columns = [(); 3].map(|()| Vec::with_capacity(samples.len()));
            for sample in samples {
                columns.iter_mut().zip(self.row(taps, sample)).for_each(|(column, value)| column.push(value));
            }
            (samples[0].point, triangular_factor(columns))
        })
    }
}

/// R of the QR decomposition of three columns, by modified Gram-Schmidt.
fn triangular_factor(mut columns: [Vec<f64>; 3]) -> [[f64; 3]; 3] {
    let mut factor = [[0.0; 3]; 3];
    for i in 0..3 {
        let (done, rest) = columns.split_at_mut(i + 1);
        let column = &mut done[i];
        let length = column.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length == 0.0 {
            continue;
        }
        factor[i][i] = length;
        column.iter_mut().for_each(|v| *v /= length);
        for (j, other) in rest.iter_mut().enumerate() {
            let part: f64 = column.iter().zip(&*other).map(|(a, b)| a * b).sum();
            factor[i][i + 1 + j] = part;
            other.iter_mut().zip(&*column).for_each(|(o, c)| *o -= part * c);
        }
    }
    factor
}

impl Misfit for DepthError {
    fn residuals(&self, taps: &[f64]) -> DVector<f64> {
        let residuals: Vec<f64> =
            self.compressed(taps).flat_map(|(_, rows)| rows.map(|[_, _, residual]| residual)).collect();
        DVector::from_vec(residuals)
    }

    fn jacobian(&self, taps: &[f64]) -> DMatrix<f64> {
        let n = self.samples.taps();
        let rows: Vec<_> = self.compressed(taps).collect();
        let mut jacobian = DMatrix::zeros(3 * rows.len(), 2 * n);
        for (i, (point, rows)) in rows.iter().enumerate() {
            for (k, [by_gm1, by_gp2, _]) in rows.iter().enumerate() {
                for (j, b) in self.samples.basis[*point].iter().enumerate() {
                    jacobian[(3 * i + k, j)] = by_gm1 * b;
                    jacobian[(3 * i + k, n + j)] = by_gp2 * b;
                }
            }
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normalised_ratio::octant;
    use crate::operators::prefilter;
    use crate::psf::Psf;

    #[test]
    fn the_depth_error_has_the_given_derivative_and_decreases() {
        let max_blur_px = 2.703;
        let otf = Psf::PillBox.otf(max_blur_px);
        let grid = octant();
        let q = prefilter::fit(&raj::prefilter_target(&otf, max_blur_px, &grid), &grid, 7).unwrap();
        let [gm1, gp1, gp2] = raj::design(&otf, max_blur_px, &q, &grid, 7).unwrap();
        let samples = Samples::new(&otf, max_blur_px, &q, &grid, &gp1);
        let taps = [gm1.octant(), gp2.octant()].concat();
        let misfit = DepthError { samples };
        let start = misfit.residuals(&taps).norm_squared();
        let gradient = misfit.jacobian(&taps).transpose() * misfit.residuals(&taps);
        let of_samples = |taps: &[f64]| -> f64 {
            misfit.samples.samples.iter().map(|s| 0.5 * misfit.row(taps, s)[2].powi(2)).sum()
        };
        assert!((2.0 * of_samples(&taps) / start - 1.0).abs() < 1e-12);
        for j in [1, 8, 12, 19] {
            let mut moved = taps.clone();
            moved[j] += 1e-6;
            let above = of_samples(&moved);
            moved[j] -= 2e-6;
            let difference = (above - of_samples(&moved)) / 2e-6;
            assert!(
                (difference - gradient[j]).abs() < 1e-4 * gradient.amax(),
                "{j}: {difference} {gradient}"
            );
        }
        let [gm1, _, gp2] = design(&otf, max_blur_px, &q, &grid, 7).unwrap();
        assert!(misfit.residuals(&[gm1.octant(), gp2.octant()].concat()).norm_squared() < start);
    }
}
