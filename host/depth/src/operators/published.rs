//! The operators of Watanabe & Nayar (1998) and of Raj & Staunton (2012), each by its authors' procedure.
//!
//! Both assume a pill-box and start from `Gp1`, the Laplacian-of-Gaussian band-pass, fitted to the kernel size. Their
//! pre-filter passes everything between 0 and the first non-monotonic frequency alike; frequencies whose NIR is merely
//! flat stay in, which is what Li 2014 (section 5.2.4) improves on.
//!
//! - *Watanabe & Nayar*: `Gm1` and `Gp2` minimise the depth error of a texture of amplitude 1/f by Levenberg-Marquardt:
//!   the residual `Gp1 alpha + Gp2 alpha^3 - NIR Gm1` over the slope `Gp1 + 3 Gp2 alpha^2` that turns it into depth,
//!   weighted with the texture's and the filters' power. (The slope is regularised where the kernels' responses vanish.)
//! - *Raj & Staunton*: two linear steps. First a linear model, `NIR Gm1 = Gp1 alpha`, gives `Gm1`; then `Gp2` corrects the
//!   error that it leaves, `NIR Gm1 - Gp1 alpha = Gp2 alpha^3`.
//!
//! Cost: Watanabe & Nayar 10 to 100 ms, Raj & Staunton some ms.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned, VecStorage};

use super::DesignError;
use super::least_squares::solve;
use super::linear::{band_pass, weights};
use crate::kernel::{self, Kernel};
use crate::nir::{GridPoint, alphas, first_non_monotonic, nir};
use crate::psf::Otf;

/// Slope (the band-pass has peak 1) below which it is regularised.
const SLOPE_FLOOR: f64 = 0.05;

/// Pre-filter target: 1 between 0 and the first non-monotonic frequency, else 0.
pub fn prefilter_target(otf: &Otf, max_blur_px: f64, grid: &[GridPoint]) -> Vec<f64> {
    let limit = first_non_monotonic(otf, max_blur_px);
    grid.iter().map(|p| if p.w > 0.0 && p.w < limit { 1.0 } else { 0.0 }).collect()
}

/// One grid point and depth: what both procedures are made of.
struct Sample {
    /// Index of the point's basis responses.
    point: usize,
    alpha: f64,
    nir: f64,
    /// Square root of the weight.
    weight: f64,
}

struct Samples {
    size: usize,
    /// Responses of the taps at each point.
    basis: Vec<Vec<f64>>,
    /// Response of the fitted Gp1 at each point.
    gp1: Vec<f64>,
    samples: Vec<Sample>,
}

impl Samples {
    fn new(otf: &Otf, max_blur_px: f64, prefilter: &Kernel, grid: &[GridPoint], gp1: &Kernel) -> Self {
        let size = gp1.size();
        let weights = weights(prefilter, grid);
        let basis = grid
            .iter()
            .map(|p| kernel::offsets(size).map(|o| kernel::basis_response(o, p.u, p.v)).collect())
            .collect();
        let samples = grid
            .iter()
            .zip(&weights)
            .enumerate()
            .flat_map(|(point, (p, weight))| {
                alphas().map(|alpha| Sample {
                    point,
                    alpha,
                    nir: nir(otf, max_blur_px, p.w, alpha),
                    weight: weight.sqrt(),
                })
            })
            // Where both OTFs vanish there is no image.
            .filter(|sample| sample.nir.is_finite())
            .collect();
        Self { size, basis, gp1: grid.iter().map(|p| gp1.response(p.u, p.v)).collect(), samples }
    }

    fn taps(&self) -> usize {
        kernel::free_coefficients(self.size)
    }

    /// The kernel `G` that minimises `sum w (factor G - target)^2` over the samples.
    fn fit(
        &self,
        factor: impl Fn(&Sample) -> f64,
        target: impl Fn(&Sample) -> f64,
    ) -> Result<Kernel, DesignError> {
        let matrix = DMatrix::from_fn(self.samples.len(), self.taps(), |i, j| {
            let sample = &self.samples[i];
            sample.weight * factor(sample) * self.basis[sample.point][j]
        });
        let rhs =
            DVector::from_iterator(self.samples.len(), self.samples.iter().map(|s| s.weight * target(s)));
        Ok(Kernel::new(self.size, solve(matrix, rhs)?.as_slice().to_vec())?)
    }

    fn response(&self, taps: &[f64], sample: &Sample) -> f64 {
        self.basis[sample.point].iter().zip(taps).map(|(b, t)| b * t).sum()
    }
}

/// The kernel of `size` nearest to the band-pass on the grid.
fn fit_band_pass(grid: &[GridPoint], size: usize) -> Result<Kernel, DesignError> {
    let offsets: Vec<_> = kernel::offsets(size).collect();
    let matrix = DMatrix::from_fn(grid.len(), offsets.len(), |i, j| {
        grid[i].multiplicity.sqrt() * kernel::basis_response(offsets[j], grid[i].u, grid[i].v)
    });
    let rhs = DVector::from_iterator(grid.len(), grid.iter().map(|p| p.multiplicity.sqrt() * band_pass(p.w)));
    Ok(Kernel::new(size, solve(matrix, rhs)?.as_slice().to_vec())?)
}

/// `[Gm1, Gp1, Gp2]` after Raj & Staunton.
///
/// # Errors
/// [`DesignError`] if a least squares is singular.
pub fn raj(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let gp1 = fit_band_pass(grid, size)?;
    let samples = Samples::new(otf, max_blur_px, prefilter, grid, &gp1);
    let first_order = |s: &Sample| samples.gp1[s.point] * s.alpha;
    let gm1 = samples.fit(|s| s.nir, first_order)?;
    let gp2 =
        samples.fit(|s| s.alpha.powi(3), |s| s.nir * samples.response(gm1.octant(), s) - first_order(s))?;
    Ok([gm1, gp1, gp2])
}

/// `[Gm1, Gp1, Gp2]` after Watanabe & Nayar.
///
/// # Errors
/// [`DesignError`] if the start or the minimisation fails.
pub fn watanabe(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let [gm1, gp1, gp2] = raj(otf, max_blur_px, prefilter, grid, size)?;
    let samples = Samples::new(otf, max_blur_px, prefilter, grid, &gp1);
    let n = samples.taps();
    let taps = DVector::from_iterator(2 * n, gm1.octant().iter().chain(gp2.octant()).copied());
    let (problem, report) =
        LevenbergMarquardt::new().with_patience(40).minimize(DepthError { samples, taps });
    if report.termination.was_usage_issue() || !report.objective_function.is_finite() {
        return Err(DesignError::Minimisation(format!("{:?}", report.termination)));
    }
    let taps = problem.taps.as_slice();
    Ok([Kernel::new(size, taps[..n].to_vec())?, gp1, Kernel::new(size, taps[n..].to_vec())?])
}

/// Watanabe & Nayar's residuals at the current taps of Gm1 and Gp2.
struct DepthError {
    samples: Samples,
    taps: DVector<f64>,
}

impl DepthError {
    /// Misfit, `s / (s^2 + floor^2)` of the slope `s`, and its derivative by `s`.
    fn parts(&self, sample: &Sample) -> [f64; 3] {
        let (gm1, gp2) = self.taps.as_slice().split_at(self.samples.taps());
        let [gm1, gp2] = [gm1, gp2].map(|taps| self.samples.response(taps, sample));
        let gp1 = self.samples.gp1[sample.point];
        let misfit = gp1 * sample.alpha + gp2 * sample.alpha.powi(3) - sample.nir * gm1;
        let slope = gp1 + 3.0 * gp2 * sample.alpha.powi(2);
        let divisor = slope * slope + SLOPE_FLOOR * SLOPE_FLOOR;
        [misfit, slope / divisor, (SLOPE_FLOOR * SLOPE_FLOOR - slope * slope) / (divisor * divisor)]
    }

    /// The residual of a sample and its derivatives by the responses of Gm1 and Gp2 at the sample's point.
    fn row(&self, sample: &Sample) -> [f64; 3] {
        let [misfit, inverse, derivative] = self.parts(sample);
        let weight = sample.weight * self.samples.gp1[sample.point];
        let by_gm1 = -weight * sample.nir * inverse;
        let by_gp2 =
            weight * (inverse * sample.alpha.powi(3) + misfit * derivative * 3.0 * sample.alpha.powi(2));
        [by_gm1, by_gp2, weight * misfit * inverse]
    }

    /// For each point three rows `[by Gm1, by Gp2, residual]` in place of one per sample: the triangular factor of the
    /// point's rows. A rotation of the rows changes neither the sum of squares nor the normal equations.
    fn compressed(&self) -> impl Iterator<Item = (usize, [[f64; 3]; 3])> {
        self.samples.samples.chunk_by(|a, b| a.point == b.point).map(|samples| {
            let mut columns = [(); 3].map(|()| Vec::with_capacity(samples.len()));
            for sample in samples {
                columns.iter_mut().zip(self.row(sample)).for_each(|(column, value)| column.push(value));
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

impl LeastSquaresProblem<f64, Dyn, Dyn> for DepthError {
    type ResidualStorage = VecStorage<f64, Dyn, nalgebra::U1>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = VecStorage<f64, Dyn, nalgebra::U1>;

    fn set_params(&mut self, taps: &DVector<f64>) {
        self.taps.copy_from(taps);
    }

    fn params(&self) -> DVector<f64> {
        self.taps.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let residuals: Vec<f64> =
            self.compressed().flat_map(|(_, rows)| rows.map(|[_, _, residual]| residual)).collect();
        Some(DVector::from_vec(residuals))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let n = self.samples.taps();
        let rows: Vec<_> = self.compressed().collect();
        let mut jacobian = DMatrix::zeros(3 * rows.len(), 2 * n);
        for (i, (point, rows)) in rows.iter().enumerate() {
            for (k, [by_gm1, by_gp2, _]) in rows.iter().enumerate() {
                for (j, b) in self.samples.basis[*point].iter().enumerate() {
                    jacobian[(3 * i + k, j)] = by_gm1 * b;
                    jacobian[(3 * i + k, n + j)] = by_gp2 * b;
                }
            }
        }
        Some(jacobian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nir::octant;
    use crate::operators::prefilter;
    use crate::psf::Psf;

    #[test]
    fn the_depth_error_has_the_derivative_it_says_and_falls() {
        let max_blur_px = 2.703;
        let otf = Psf::PillBox.otf(max_blur_px);
        let grid = octant();
        let q = prefilter::fit(&prefilter_target(&otf, max_blur_px, &grid), &grid, 7).unwrap();
        let [gm1, gp1, gp2] = raj(&otf, max_blur_px, &q, &grid, 7).unwrap();
        let samples = Samples::new(&otf, max_blur_px, &q, &grid, &gp1);
        let taps = DVector::from_iterator(20, gm1.octant().iter().chain(gp2.octant()).copied());
        let mut problem = DepthError { samples, taps: taps.clone() };
        let start = problem.residuals().unwrap().norm_squared();
        // The gradient of half the sum of squares, which does not depend on how the rows are compressed.
        let gradient = problem.jacobian().unwrap().transpose() * problem.residuals().unwrap();
        let of_samples = |problem: &DepthError| -> f64 {
            problem.samples.samples.iter().map(|s| 0.5 * problem.row(s)[2].powi(2)).sum()
        };
        assert!((2.0 * of_samples(&problem) / start - 1.0).abs() < 1e-12);
        for j in [1, 8, 12, 19] {
            let mut moved = taps.clone();
            moved[j] += 1e-6;
            problem.set_params(&moved);
            let above = of_samples(&problem);
            moved[j] -= 2e-6;
            problem.set_params(&moved);
            let difference = (above - of_samples(&problem)) / 2e-6;
            assert!(
                (difference - gradient[j]).abs() < 1e-4 * gradient.amax(),
                "{j}: {difference} {gradient}"
            );
        }
        let [gm1, _, gp2] = watanabe(&otf, max_blur_px, &q, &grid, 7).unwrap();
        problem.set_params(&DVector::from_iterator(20, gm1.octant().iter().chain(gp2.octant()).copied()));
        assert!(problem.residuals().unwrap().norm_squared() < start);
    }
}
