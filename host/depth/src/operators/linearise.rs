//! Removes the cubic's error: a polynomial that makes the estimated alpha proportional to the true one.
//!
//! No cubic fits the NIR over the whole range, so the run time's alpha has a smooth, odd error: up to 0.1 mm at the
//! ends of the rig's range. For a texture of known spectrum `S^2` the window sums have the expectations
//! `c1 = sum S^2 Q^2 P^2 Gp1^2`, `c3 = sum S^2 Q^2 P^2 Gp1 Gp2`, `c0 = sum S^2 Q^2 P Gp1 D Gm1` with `P = H2 + H1`,
//! `D = H2 - H1`, which give the estimate for each true alpha. An odd polynomial of degree 7 inverts it. The spectrum
//! is 1/f power behind a square pixel, between sand (nearly white) and natural textures (1/f^2); for both it removes at
//! least two thirds of the error. Cost: 153 x 45 OTF pairs, about 1 ms; at run time four multiply-adds per pixel.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use super::DesignError;
use super::least_squares::solve;
use crate::cubic::MAX_ALPHA;
use crate::kernel::Kernel;
use crate::normalised_ratio::{GRID, GridPoint, sum_and_difference};
use crate::psf::Otf;

/// Coefficients of alpha, alpha^3, alpha^5, alpha^7.
pub type Polynomial = [f64; 4];

/// The identity.
pub const IDENTITY: Polynomial = [1.0, 0.0, 0.0, 0.0];

/// Largest alpha of the fit: a little beyond the working range.
const REACH: f64 = 1.1;

const SAMPLES: usize = 45;

/// The polynomial for `[Gm1, Gp1, Gp2]` and their pre-filter. Returns [`DesignError::Singular`] if they find no alpha.
pub fn design(
    otf: &Otf,
    max_blur_px: f64,
    prefilter: &Kernel,
    [gm1, gp1, gp2]: [&Kernel; 3],
    grid: &[GridPoint],
) -> Result<Polynomial, DesignError> {
    let unit = 2.0 * PI / GRID as f64;
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    let points: Vec<[f64; 5]> = grid
        .iter()
        .filter(|p| p.w > 0.0)
        .map(|p| {
            let texture = (sinc(0.5 * p.u) * sinc(0.5 * p.v)).powi(2) / p.w.max(unit);
            let power = p.multiplicity * texture * prefilter.response(p.u, p.v).powi(2);
            [p.w, power, gm1.response(p.u, p.v), gp1.response(p.u, p.v), gp2.response(p.u, p.v)]
        })
        .collect();
    let found = |alpha: f64| {
        let [mut c1, mut c3, mut c0] = [0.0; 3];
        for [w, power, gm1, gp1, gp2] in &points {
            let [sum, difference] = sum_and_difference(otf, max_blur_px, *w, alpha);
            let p1 = sum * gp1;
            c1 += power * p1 * p1;
            c3 += power * p1 * sum * gp2;
            c0 += power * p1 * difference * gm1;
        }
        root(c0 / c1, c3 / c1)
    };
    let samples: Vec<[f64; 2]> = (0..SAMPLES)
        .map(|i| REACH * (2.0 * i as f64 / (SAMPLES - 1) as f64 - 1.0))
        .filter_map(|alpha| Some([alpha, found(alpha)?]))
        .collect();
    let matrix = DMatrix::from_fn(samples.len(), 4, |i, j| samples[i][1].powi(2 * j as i32 + 1));
    let rhs = DVector::from_iterator(samples.len(), samples.iter().map(|s| s[0]));
    if samples.len() < 4 {
        return Err(DesignError::Singular { unknowns: 4 });
    }
    let solution = solve(matrix, rhs)?;
    Ok([solution[0], solution[1], solution[2], solution[3]])
}

/// Root of `alpha + cubic alpha^3 = ratio` as in the run time; `None` beyond the turning point.
fn root(ratio: f64, cubic: f64) -> Option<f64> {
    let limit = (1.0 / (3.0 * (-cubic).max(1e-6))).sqrt().min(f64::from(MAX_ALPHA));
    let mut alpha = ratio.abs().min(limit);
    for _ in 0..30 {
        let slope = (1.0 + 3.0 * cubic * alpha * alpha).max(0.02);
        alpha = (alpha - (alpha + cubic * alpha.powi(3) - ratio.abs()) / slope).min(limit);
    }
    (alpha < 0.98 * limit).then(|| alpha.copysign(ratio))
}

/// Value of the polynomial.
pub fn value(polynomial: &Polynomial, alpha: f64) -> f64 {
    let square = alpha * alpha;
    alpha * polynomial.iter().rev().fold(0.0, |sum, c| sum * square + c)
}

/// Slope of the polynomial.
pub fn slope(polynomial: &Polynomial, alpha: f64) -> f64 {
    let square = alpha * alpha;
    polynomial.iter().enumerate().rev().fold(0.0, |sum, (i, c)| sum * square + (2 * i + 1) as f64 * c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_and_slope_belong_together() {
        let p = [0.99, 0.04, -0.03, -0.003];
        assert_eq!(value(&IDENTITY, 0.7), 0.7);
        assert!((value(&p, 1.0) - 0.997).abs() < 1e-12 && (value(&p, -1.0) + 0.997).abs() < 1e-12);
        let difference = (value(&p, 0.6 + 1e-6) - value(&p, 0.6 - 1e-6)) / 2e-6;
        assert!((slope(&p, 0.6) - difference).abs() < 1e-8);
    }
}
