//! The `linear` design: all three rational operators from one linear least squares.
//!
//! `min sum W mean_alpha (NIR Gm1 - alpha Gp1 - alpha^3 Gp2)^2 + 0.03 sum (m / sum m) (Gp1 - LOG)^2` over the taps of
//! the three kernels. `W ~ m Q'^2 max(w, 0.19)^-2` (sum 1) is the power of a natural texture (amplitude 1/f) behind the
//! pre-filter `Q'`. The second term fixes the common scale and spectral shape, which the first leaves free:
//! `LOG = (w / wp)^2 exp(1 - (w / wp)^2)`, `wp = 0.4 pi` (W&N 1998's band-pass). Eq. 5.18 of Li 2014 as printed divides
//! by Gm1 (poles) and weights only the NIR with Q. Cost: 153 frequencies x 21 depths, 30 unknowns for 7x7, 1 ms.

use super::{DesignError, least_squares};
use crate::kernel::{self, Kernel};
use crate::normalised_ratio::{GRID, GridPoint, alphas, sum_and_difference};
use crate::psf::Otf;

/// Weight of the second term.
const BAND_PASS_WEIGHT: f64 = 0.03;

/// Peak frequency of the band-pass in rad/px.
pub const BAND_PASS_PEAK: f64 = 0.4 * std::f64::consts::PI;

/// Frequency below which textures count as white, rad/px: the grid's first.
const TEXTURE_FLOOR: f64 = 2.0 * std::f64::consts::PI / GRID as f64 * 0.97;

/// The Laplacian-of-Gaussian band-pass with peak 1 at [`BAND_PASS_PEAK`].
pub fn band_pass(w: f64) -> f64 {
    let x = (w / BAND_PASS_PEAK).powi(2);
    x * (1.0 - x).exp()
}

/// Weight of each grid point, sum 1: its multiplicity, the pre-filter's power and the texture's.
pub fn weights(prefilter: &Kernel, grid: &[GridPoint]) -> Vec<f64> {
    let raw: Vec<f64> = grid
        .iter()
        .map(|p| p.multiplicity * (prefilter.response(p.u, p.v) / p.w.max(TEXTURE_FLOOR)).powi(2))
        .collect();
    let total: f64 = raw.iter().sum();
    raw.into_iter().map(|w| w / total).collect()
}

/// `[Gm1, Gp1, Gp2]` of `size` for the pre-filter's response. Returns [`DesignError`] if the least squares is singular.
pub fn design(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let samples = alphas();
    let weights = weights(prefilter, grid);
    let multiplicities: f64 = grid.iter().map(|p| p.multiplicity).sum();
    let mut rows: Vec<(Vec<f64>, f64)> = Vec::with_capacity(3 * grid.len());
    for (p, weight) in grid.iter().zip(&weights) {
        let mut equations = Vec::with_capacity(samples.len() + 1);
        for alpha in samples {
            let [sum, difference] = sum_and_difference(otf, max_blur_px, p.w, alpha);
            let normalised_ratio = difference / sum;
            if !normalised_ratio.is_finite() {
                // Both OTFs vanish: no image has this frequency at this depth.
                continue;
            }
            let scale = (weight / samples.len() as f64).sqrt();
            equations.push((vec![scale * normalised_ratio, -scale * alpha, -scale * alpha.powi(3)], 0.0));
        }
        let scale = (BAND_PASS_WEIGHT * p.multiplicity / multiplicities).sqrt();
        equations.push((vec![0.0, scale, 0.0], scale * band_pass(p.w)));
        rows.extend(least_squares::in_taps(&equations, &kernel::basis_responses(size, p.u, p.v)));
    }
    let (matrix, right) = least_squares::reduced(&rows);
    Ok(Kernel::several(size, least_squares::solve(matrix, right)?.as_slice())?)
}
