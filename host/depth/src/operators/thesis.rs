//! The `thesis` design: all three rational operators by Levenberg-Marquardt (Li 2014, eqs. 5.18 and 5.19).
//!
//! `min sum m Q'^2 (NIR - (Gp1 alpha + Gp2 alpha^3) / Gm1)^2` over the taps of the three kernels. The printed 5.18 weights
//! only the NIR with the pre-filter, although it cancels at run time; here Q weights the whole residual. Signed
//! zero-phase responses are fitted instead of magnitudes, which would lose the sign of Gp2. Frequency 0, where the NIR
//! vanishes and Q is 0, is left out.
//!
//! Start: Gp1 = the Laplacian-of-Gaussian band-pass, `Gm1 = Gp1 / a1` and `Gp2 = a3 Gm1` from the cubic fit of the NIR,
//! the latter two by Parks-McClellan and McClellan ([`super::start`]). The common scale of the kernels is a direction in
//! which nothing changes; it is fixed afterwards. The common spectral shape stays near the start.
//!
//! Cost: 152 x 10 residuals in 30 unknowns for 7x7, some hundred iterations, 0.2 to 0.8 s.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned, VecStorage};

use super::DesignError;
use super::linear::band_pass;
use super::start::kernel_of_radial_response;
use crate::kernel::{self, Kernel};
use crate::nir::{ALPHA_SAMPLES, GridPoint, NirFit, alphas, nir};
use crate::psf::Otf;

/// Evaluations per unknown after which the minimisation ends where it is.
const PATIENCE: usize = 10;

/// Relative change of the cost and of the taps below which it ends: depth errors no longer change in the third digit.
const TOLERANCE: f64 = 1e-6;

/// Samples of alpha above 0: the residual is odd in alpha, so those below 0 would only double every square.
const SAMPLES: usize = ALPHA_SAMPLES / 2;

/// The samples of alpha above 0.
fn depths() -> [f64; SAMPLES] {
    let all = alphas();
    std::array::from_fn(|i| all[SAMPLES + 1 + i])
}

/// `[Gm1, Gp1, Gp2]` of `size` for the pre-filter's response.
///
/// # Errors
/// [`DesignError`] if the start or the minimisation fails.
pub fn design(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    fit: &NirFit,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let start = starting_kernels(fit, size)?;
    let problem = Problem::new(otf, max_blur_px, prefilter, grid, &start);
    let (problem, report) =
        LevenbergMarquardt::new().with_tol(TOLERANCE).with_patience(PATIENCE).minimize(problem);
    if report.termination.was_usage_issue() || !report.objective_function.is_finite() {
        return Err(DesignError::Minimisation(format!("{:?}", report.termination)));
    }
    let [gm1, gp1, gp2] = problem.kernels(size)?;
    // The scale means nothing: give Gp1 the band-pass's peak.
    let peak = (0..=64)
        .map(|i| gp1.response(std::f64::consts::PI * f64::from(i) / 64.0, 0.0).abs())
        .fold(0.0, f64::max);
    let scale = 1.0 / peak.max(f64::MIN_POSITIVE);
    Ok([gm1.scaled(scale), gp1.scaled(scale), gp2.scaled(scale)])
}

/// `[Gm1, Gp1, Gp2]` to start from.
pub(super) fn starting_kernels(fit: &NirFit, size: usize) -> Result<[Kernel; 3], DesignError> {
    // The cubic's coefficients at any frequency: linear between the table's, constant beyond.
    let at = |column: &[f64], w: f64| {
        let table = &fit.frequency_rad_px;
        let i = table.partition_point(|f| *f < w).clamp(1, table.len() - 1);
        let t = ((w - table[i - 1]) / (table[i] - table[i - 1])).clamp(0.0, 1.0);
        column[i - 1] + t * (column[i] - column[i - 1])
    };
    if fit.frequency_rad_px.len() < 2 {
        return Err(DesignError::Start("the NIR rises at fewer than two frequencies".to_owned()));
    }
    // At frequency 0 both vanish like w^2, so the ratio is taken at the table's first frequency.
    let gm1 = |w: f64| {
        let w = w.max(fit.frequency_rad_px[0]);
        band_pass(w) / at(&fit.linear, w)
    };
    let gp2 = |w: f64| at(&fit.cubic, w) * gm1(w);
    Ok([
        kernel_of_radial_response(gm1, size)?,
        kernel_of_radial_response(band_pass, size)?,
        kernel_of_radial_response(gp2, size)?,
    ])
}

/// The residuals at the current kernels.
struct Problem {
    /// Responses of the taps at each point, and the point's weight.
    points: Vec<(Vec<f64>, f64)>,
    /// NIR at each point and alpha.
    nir: Vec<[f64; SAMPLES]>,
    /// Taps of Gm1, Gp1, Gp2 after each other.
    taps: DVector<f64>,
}

impl Problem {
    fn new(otf: &Otf, max_blur_px: f64, prefilter: &Kernel, grid: &[GridPoint], start: &[Kernel; 3]) -> Self {
        let size = start[0].size();
        let mut points = Vec::new();
        let mut ratios = Vec::new();
        for p in grid.iter().filter(|p| p.w > 0.0) {
            let ratio = depths().map(|a| nir(otf, max_blur_px, p.w, a));
            if ratio.iter().all(|r| r.is_finite()) {
                let basis = kernel::offsets(size).map(|o| kernel::basis_response(o, p.u, p.v)).collect();
                points.push((basis, p.multiplicity.sqrt() * prefilter.response(p.u, p.v)));
                ratios.push(ratio);
            }
        }
        let taps = DVector::from_iterator(
            3 * start[0].octant().len(),
            start.iter().flat_map(|k| k.octant().iter().copied()),
        );
        Self { points, nir: ratios, taps }
    }

    fn kernels(&self, size: usize) -> Result<[Kernel; 3], DesignError> {
        let n = self.taps.len() / 3;
        let part = |i: usize| Kernel::new(size, self.taps.as_slice()[i * n..(i + 1) * n].to_vec());
        Ok([part(0)?, part(1)?, part(2)?])
    }

    /// `[Gm1, Gp1, Gp2]` at a point.
    fn responses(&self, basis: &[f64]) -> [f64; 3] {
        let n = basis.len();
        [0, 1, 2]
            .map(|i| basis.iter().zip(&self.taps.as_slice()[i * n..(i + 1) * n]).map(|(b, t)| b * t).sum())
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem {
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
        let samples = depths();
        let mut residuals = Vec::with_capacity(self.points.len() * samples.len());
        for ((basis, weight), ratios) in self.points.iter().zip(&self.nir) {
            let [gm1, gp1, gp2] = self.responses(basis);
            residuals.extend(
                samples
                    .iter()
                    .zip(ratios)
                    .map(|(a, ratio)| weight * (ratio - (gp1 * a + gp2 * a.powi(3)) / gm1)),
            );
        }
        Some(DVector::from_vec(residuals))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let samples = depths();
        let n = self.taps.len() / 3;
        let mut jacobian = DMatrix::zeros(self.points.len() * samples.len(), 3 * n);
        for (i, (basis, weight)) in self.points.iter().enumerate() {
            let [gm1, gp1, gp2] = self.responses(basis);
            for (k, a) in samples.iter().enumerate() {
                let cubic = gp1 * a + gp2 * a.powi(3);
                let factors = [cubic / (gm1 * gm1), -a / gm1, -a.powi(3) / gm1].map(|f| f * weight);
                for (part, factor) in factors.iter().enumerate() {
                    for (j, b) in basis.iter().enumerate() {
                        jacobian[(i * samples.len() + k, part * n + j)] = factor * b;
                    }
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
    fn the_jacobian_is_the_derivative() {
        let rmax = 2.703;
        let otf = Psf::Gaussian { k: 0.4578 }.otf(rmax);
        let grid = octant();
        let q = prefilter::fit(&prefilter::target(&otf, rmax, &grid).unwrap(), &grid, 7).unwrap();
        let fit = NirFit::new(&otf, rmax, f64::INFINITY);
        let start = starting_kernels(&fit, 7).unwrap();
        let mut problem = Problem::new(&otf, rmax, &q, &grid, &start);
        let jacobian = problem.jacobian().unwrap();
        let at = problem.params();
        for j in [0, 4, 13, 27] {
            let mut moved = at.clone();
            moved[j] += 1e-6;
            problem.set_params(&moved);
            let above = problem.residuals().unwrap();
            moved[j] -= 2e-6;
            problem.set_params(&moved);
            let below = problem.residuals().unwrap();
            let difference = (above - below) / 2e-6;
            let error = (&difference - jacobian.column(j)).amax();
            assert!(error < 1e-4 * difference.amax().max(1.0), "{j}: {error}");
        }
    }
}
