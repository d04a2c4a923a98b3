//! The `thesis` design: all three rational operators by Levenberg-Marquardt (Li 2014, eqs. 5.18 and 5.19).
//!
//! `min sum m Q'^2 (NIR - (Gp1 alpha + Gp2 alpha^3) / Gm1)^2` over the taps of the three kernels. The printed 5.18
//! weights only the NIR with the pre-filter, although it cancels at run time; here Q weights the whole residual. Signed
//! zero-phase responses replace magnitudes, which would lose the sign of Gp2. Frequency 0, where NIR and Q are 0, is
//! left out. Start: Gp1 = the Laplacian-of-Gaussian band-pass, `Gm1 = Gp1 / a1` and `Gp2 = a3 Gm1` from the NIR's cubic
//! fit, the latter two by Parks-McClellan and McClellan ([`super::start`]). The kernels' common scale has no effect and
//! is fixed afterwards. Cost: 152 x 10 residuals in 30 unknowns for 7x7, some hundred iterations, 0.2 to 0.8 s.

use levenberg_marquardt::LevenbergMarquardt;
use nalgebra::{DMatrix, DVector};

use super::DesignError;
use super::linear::band_pass;
use super::minimise::{Misfit, minimise};
use super::start::kernel_of_radial_response;
use crate::kernel::{self, Kernel};
use crate::normalised_ratio::{ALPHA_SAMPLES, GridPoint, RatioFit, alphas, normalised_ratio};
use crate::psf::Otf;

const PATIENCE: usize = 10;

/// Relative change of cost and taps that ends it: depth errors no longer change in the third digit.
const TOLERANCE: f64 = 1e-6;

/// Samples of alpha above 0: the residual is odd in alpha.
const SAMPLES: usize = ALPHA_SAMPLES / 2;

fn depths() -> [f64; SAMPLES] {
    let all = alphas();
    std::array::from_fn(|i| all[SAMPLES + 1 + i])
}

/// `[Gm1, Gp1, Gp2]` of `size` for the pre-filter's response. Returns [`DesignError`] if start or minimisation fail.
pub fn design(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    fit: &RatioFit,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let start = starting_kernels(fit, size)?.each_ref().map(Kernel::octant).concat();
    let misfit = RatioError::new(otf, max_blur_px, prefilter, grid, size);
    let search = LevenbergMarquardt::new().with_tol(TOLERANCE).with_patience(PATIENCE);
    let [gm1, gp1, gp2] = Kernel::several(size, &minimise(misfit, start, &search)?)?;
    // The scale is arbitrary: give Gp1 the band-pass's peak.
    let peak = (0..=64)
        .map(|i| gp1.response(std::f64::consts::PI * f64::from(i) / 64.0, 0.0).abs())
        .fold(0.0, f64::max);
    let scale = 1.0 / peak.max(f64::MIN_POSITIVE);
    Ok([gm1.scaled(scale), gp1.scaled(scale), gp2.scaled(scale)])
}

fn starting_kernels(fit: &RatioFit, size: usize) -> Result<[Kernel; 3], DesignError> {
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

/// Weighted `NIR - (Gp1 alpha + Gp2 alpha^3) / Gm1` at each point and depth; taps of Gm1, Gp1, Gp2 in sequence.
struct RatioError {
    /// Responses of the taps at each point, and the point's weight.
    points: Vec<(Vec<f64>, f64)>,
    normalised_ratio: Vec<[f64; SAMPLES]>,
}

impl RatioError {
    fn new(otf: &Otf, max_blur_px: f64, prefilter: &Kernel, grid: &[GridPoint], size: usize) -> Self {
        let (mut points, mut ratios) = (Vec::new(), Vec::new());
        for p in grid.iter().filter(|p| p.w > 0.0) {
            let ratio = depths().map(|a| normalised_ratio(otf, max_blur_px, p.w, a));
            if ratio.iter().all(|r| r.is_finite()) {
                let weight = p.multiplicity.sqrt() * prefilter.response(p.u, p.v);
                points.push((kernel::basis_responses(size, p.u, p.v), weight));
                ratios.push(ratio);
            }
        }
        Self { points, normalised_ratio: ratios }
    }
}

fn responses(basis: &[f64], taps: &[f64]) -> [f64; 3] {
    let n = basis.len();
    [0, 1, 2].map(|i| basis.iter().zip(&taps[i * n..(i + 1) * n]).map(|(b, t)| b * t).sum())
}

impl Misfit for RatioError {
    fn residuals(&self, taps: &[f64]) -> DVector<f64> {
        let samples = depths();
        let mut residuals = Vec::with_capacity(self.points.len() * samples.len());
        for ((basis, weight), ratios) in self.points.iter().zip(&self.normalised_ratio) {
            let [gm1, gp1, gp2] = responses(basis, taps);
            residuals.extend(
                samples
                    .iter()
                    .zip(ratios)
                    .map(|(a, ratio)| weight * (ratio - (gp1 * a + gp2 * a.powi(3)) / gm1)),
            );
        }
        DVector::from_vec(residuals)
    }

    fn jacobian(&self, taps: &[f64]) -> DMatrix<f64> {
        let samples = depths();
        let n = taps.len() / 3;
        let mut jacobian = DMatrix::zeros(self.points.len() * samples.len(), 3 * n);
        for (i, (basis, weight)) in self.points.iter().enumerate() {
            let [gm1, gp1, gp2] = responses(basis, taps);
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
    fn the_jacobian_is_the_derivative() {
        let rmax = 2.703;
        let otf = Psf::Gaussian { k: 0.4578 }.otf(rmax);
        let grid = octant();
        let q = prefilter::fit(&prefilter::target(&otf, rmax, &grid).unwrap(), &grid, 7).unwrap();
        let fit = RatioFit::new(&otf, rmax, f64::INFINITY);
        let misfit = RatioError::new(&otf, rmax, &q, &grid, 7);
        let at = starting_kernels(&fit, 7).unwrap().each_ref().map(Kernel::octant).concat();
        let jacobian = misfit.jacobian(&at);
        for j in [0, 4, 13, 27] {
            let mut moved = at.clone();
            moved[j] += 1e-6;
            let above = misfit.residuals(&moved);
            moved[j] -= 2e-6;
            let below = misfit.residuals(&moved);
            let difference = (above - below) / 2e-6;
            let error = (&difference - jacobian.column(j)).amax();
            assert!(error < 1e-4 * difference.amax().max(1.0), "{j}: {error}");
        }
    }
}
