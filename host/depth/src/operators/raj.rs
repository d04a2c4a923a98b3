//! The operators of Raj & Staunton (2012), by their procedure.
//!
//! They assume a pill-box and start from `Gp1`, the Laplacian-of-Gaussian band-pass, fitted to the kernel size. First a
//! linear model, `NIR Gm1 = Gp1 alpha`, gives `Gm1`; then `Gp2` corrects its error,
//! `NIR Gm1 - Gp1 alpha = Gp2 alpha^3`. The pre-filter passes everything between 0 and the first non-monotonic
//! frequency; frequencies of flat NIR stay in, which Li 2014 (section 5.2.4) improves on. Cost: some ms.

use nalgebra::{DMatrix, DVector};

use super::DesignError;
use super::least_squares::solve;
use super::linear::band_pass;
use super::samples::{Sample, Samples};
use crate::kernel::{self, Kernel};
use crate::normalised_ratio::{GridPoint, first_non_monotonic};
use crate::psf::Otf;

/// Pre-filter target: 1 between 0 and the first non-monotonic frequency, else 0.
pub fn prefilter_target(otf: &Otf, max_blur_px: f64, grid: &[GridPoint]) -> Vec<f64> {
    let limit = first_non_monotonic(otf, max_blur_px);
    grid.iter().map(|p| if p.w > 0.0 && p.w < limit { 1.0 } else { 0.0 }).collect()
}

fn fit_band_pass(grid: &[GridPoint], size: usize) -> Result<Kernel, DesignError> {
    let offsets: Vec<_> = kernel::offsets(size).collect();
    let matrix = DMatrix::from_fn(grid.len(), offsets.len(), |i, j| {
        grid[i].multiplicity.sqrt() * kernel::basis_response(offsets[j], grid[i].u, grid[i].v)
    });
    let rhs = DVector::from_iterator(grid.len(), grid.iter().map(|p| p.multiplicity.sqrt() * band_pass(p.w)));
    Ok(Kernel::new(size, solve(matrix, rhs)?.as_slice().to_vec())?)
}

/// `[Gm1, Gp1, Gp2]` after Raj & Staunton. Returns [`DesignError`] if a least squares is singular.
pub fn design(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    grid: &[GridPoint],
    size: usize,
) -> Result<[Kernel; 3], DesignError> {
    let gp1 = fit_band_pass(grid, size)?;
    let samples = Samples::new(otf, max_blur_px, prefilter, grid, &gp1);
    let first_order = |s: &Sample| samples.gp1[s.point] * s.alpha;
    let gm1 = samples.fit(|s| s.normalised_ratio, first_order)?;
    let gp2 = samples.fit(
        |s| s.alpha.powi(3),
        |s| s.normalised_ratio * samples.response(gm1.octant(), s) - first_order(s),
    )?;
    Ok([gm1, gp1, gp2])
}
