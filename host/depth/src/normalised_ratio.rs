//! The normalised image ratio (NIR), its cubic fit over depth, and the frequency grid of the operator design.
//!
//! `NIR(w, alpha) = (H2 - H1) / (H2 + H1)` with `H1` the far-focused OTF (sign of Li 2014, eq. 1.7: `M = I2 - I1`; 1.5
//! and 5.2 print the other one). It rises with alpha and is odd in it. Each frequency is fitted by
//! `a1(w) alpha + a3(w) alpha^3` over alpha in [-1, 1]. Frequencies in rad/px. The grid is the 32x32 DFT, reduced to
//! the octant `0 <= v <= u <= 16` with multiplicities (153 points) and 21 depths. Cost: 153 x 21 OTF pairs, about 1 ms.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::psf::Otf;

/// Side of the discrete Fourier transform on which operators are designed.
pub const GRID: usize = 32;

/// Number of samples of alpha in [-1, 1].
pub const ALPHA_SAMPLES: usize = 21;

/// The samples of alpha, -1 to 1.
pub fn alphas() -> [f64; ALPHA_SAMPLES] {
    std::array::from_fn(|i| -1.0 + 2.0 * i as f64 / (ALPHA_SAMPLES - 1) as f64)
}

/// A point of the grid's octant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridPoint {
    /// Horizontal frequency, rad/px.
    pub u: f64,
    /// Vertical frequency, rad/px; at most `u`.
    pub v: f64,
    /// Radial frequency, rad/px.
    pub w: f64,
    /// Number of grid points it represents.
    pub multiplicity: f64,
}

/// The octant of the [`GRID`], frequency 0 first.
pub fn octant() -> Vec<GridPoint> {
    let half = GRID / 2;
    // 0 and the Nyquist frequency are their own mirror images.
    let mirrored = |i: usize| if i == 0 || i == half { 1.0 } else { 2.0 };
    let unit = 2.0 * PI / GRID as f64;
    (0..=half)
        .flat_map(|i| (0..=i).map(move |j| (i, j)))
        .map(|(i, j)| {
            let [u, v] = [unit * i as f64, unit * j as f64];
            let swapped = if i == j { 1.0 } else { 2.0 };
            GridPoint { u, v, w: u.hypot(v), multiplicity: swapped * mirrored(i) * mirrored(j) }
        })
        .collect()
}

/// Sum and difference `[H2 + H1, H2 - H1]` of the OTFs at the radial frequency `w` (rad/px) and depth `alpha`.
pub fn sum_and_difference(otf: &Otf, max_blur_px: f64, w: f64, alpha: f64) -> [f64; 2] {
    let far = otf.at(0.5 * (1.0 + alpha) * max_blur_px, w);
    let near = otf.at(0.5 * (1.0 - alpha) * max_blur_px, w);
    [near + far, near - far]
}

/// NIR at the radial frequency `w` (rad/px) and depth `alpha`; not finite at a common zero of both OTFs.
pub fn normalised_ratio(otf: &Otf, max_blur_px: f64, w: f64, alpha: f64) -> f64 {
    let [sum, difference] = sum_and_difference(otf, max_blur_px, w, alpha);
    difference / sum
}

/// Smallest slope of the NIR over alpha in [-1, 1] at frequency `w`; not positive where a ratio has several depths.
pub fn smallest_slope(otf: &Otf, max_blur_px: f64, w: f64) -> f64 {
    const STEPS: usize = 80;
    let at = |i: usize| normalised_ratio(otf, max_blur_px, w, -1.0 + 2.0 * i as f64 / STEPS as f64);
    // NIR is odd in alpha, so half the range suffices; a non-finite value counts as no slope.
    let mut previous = at(STEPS / 2);
    let mut smallest = f64::INFINITY;
    for i in STEPS / 2 + 1..=STEPS {
        let next = at(i);
        let slope = (next - previous) * STEPS as f64 / 2.0;
        if !slope.is_finite() {
            return f64::NEG_INFINITY;
        }
        smallest = smallest.min(slope);
        previous = next;
    }
    smallest
}

/// First radial frequency (rad/px, to 1 %, because alpha is sampled) at which the NIR does not rise over all alpha in [-1, 1];
/// infinite if none.
pub fn first_non_monotonic(otf: &Otf, max_blur_px: f64) -> f64 {
    let falls = |w: f64| smallest_slope(otf, max_blur_px, w) <= 0.0;
    const STEPS: usize = 400;
    let end = std::f64::consts::SQRT_2 * PI;
    let step = end / STEPS as f64;
    let Some(i) = (1..=STEPS).find(|i| falls(step * *i as f64)) else { return f64::INFINITY };
    let [mut below, mut above] = [step * (i as f64 - 1.0), step * i as f64];
    while above - below > 1e-6 {
        let middle = 0.5 * (below + above);
        if middle > 0.0 && falls(middle) {
            above = middle;
        } else {
            below = middle;
        }
    }
    above
}

/// The cubic fit of the NIR, one entry per radial frequency of the grid, ascending.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RatioFit {
    /// Radial frequencies, rad/px.
    pub frequency_rad_px: Vec<f64>,
    /// Coefficient a1 of alpha.
    pub linear: Vec<f64>,
    /// Coefficient a3 of alpha^3.
    pub cubic: Vec<f64>,
    /// Root-mean-square misfit over alpha.
    pub rms: Vec<f64>,
}

impl RatioFit {
    /// Fits the NIR at every radial frequency of the grid above 0 and below `up_to_rad_px`.
    pub fn new(otf: &Otf, max_blur_px: f64, up_to_rad_px: f64) -> Self {
        let mut radii: Vec<f64> =
            octant().iter().map(|p| p.w).filter(|w| *w > 0.0 && *w < up_to_rad_px).collect();
        radii.sort_by(f64::total_cmp);
        radii.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let mut fit = Self::default();
        for w in radii {
            let [linear, cubic, rms] = fit_cubic(otf, max_blur_px, w);
            fit.frequency_rad_px.push(w);
            fit.linear.push(linear);
            fit.cubic.push(cubic);
            fit.rms.push(rms);
        }
        fit
    }

    /// Root-mean-square misfit over all frequencies of the table; 0 for an empty one.
    pub fn total_rms(&self) -> f64 {
        let mean = self.rms.iter().map(|r| r * r).sum::<f64>() / self.rms.len().max(1) as f64;
        mean.sqrt()
    }
}

/// `[a1, a3, rms]` at one frequency: two normal equations, even moments of alpha.
fn fit_cubic(otf: &Otf, max_blur_px: f64, w: f64) -> [f64; 3] {
    let samples = alphas().map(|a| (a, normalised_ratio(otf, max_blur_px, w, a)));
    let moment = |n: i32| samples.iter().map(|(a, _)| a.powi(n)).sum::<f64>();
    let product = |n: i32| samples.iter().map(|(a, y)| a.powi(n) * y).sum::<f64>();
    let [s2, s4, s6] = [2, 4, 6].map(moment);
    let [y1, y3] = [1, 3].map(product);
    let determinant = s2 * s6 - s4 * s4;
    let linear = (y1 * s6 - y3 * s4) / determinant;
    let cubic = (s2 * y3 - s4 * y1) / determinant;
    let misfit = samples.iter().map(|(a, y)| (y - linear * a - cubic * a.powi(3)).powi(2)).sum::<f64>();
    [linear, cubic, (misfit / ALPHA_SAMPLES as f64).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::psf::Psf;

    const RMAX: f64 = 2.703;

    #[test]
    fn one_octant_represents_the_whole_grid() {
        let total: f64 = octant().iter().map(|p| p.multiplicity).sum();
        assert_eq!(total, (GRID * GRID) as f64);
        assert_eq!(octant()[0].w, 0.0);
    }

    #[test]
    fn nir_is_odd_and_rises_with_alpha() {
        for psf in [Psf::PillBox, Psf::Gaussian { k: 0.4578 }] {
            let otf = psf.otf(RMAX);
            for w in [0.2, 0.6, 1.0] {
                assert!(normalised_ratio(&otf, RMAX, w, 0.0).abs() < 1e-12);
                assert!(
                    (normalised_ratio(&otf, RMAX, w, 0.7) + normalised_ratio(&otf, RMAX, w, -0.7)).abs()
                        < 1e-12
                );
                assert!(normalised_ratio(&otf, RMAX, w, 0.9) > normalised_ratio(&otf, RMAX, w, 0.3));
            }
        }
    }

    #[test]
    fn the_gaussian_nir_is_a_hyperbolic_tangent() {
        // (exp(-a) - exp(-b)) / (exp(-a) + exp(-b)) = tanh((b - a) / 2), with a, b the exponents of the two OTFs.
        let k = 0.4578;
        let otf = Psf::Gaussian { k }.otf(RMAX);
        for (w, alpha) in [(0.5, 0.3), (1.5, -0.8), (3.0, 1.0)] {
            let expected = (0.25 * (k * RMAX * w).powi(2) * alpha).tanh();
            assert!((normalised_ratio(&otf, RMAX, w, alpha) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn only_the_pill_box_has_a_non_monotonic_frequency() {
        let limit = first_non_monotonic(&Psf::PillBox.otf(RMAX), RMAX);
        // Above the first zero of the largest blur's OTF and about its first minimum (z = 5.136).
        assert!(limit * RMAX > 3.8 && limit * RMAX < 5.2, "{limit}");
        assert_eq!(first_non_monotonic(&Psf::Gaussian { k: 0.3 }.otf(RMAX), RMAX), f64::INFINITY);
    }

    #[test]
    fn the_fit_is_good_where_the_nir_is_smooth() {
        let otf = Psf::Gaussian { k: 0.4578 }.otf(RMAX);
        let fit = RatioFit::new(&otf, RMAX, 1.2);
        assert!(fit.total_rms() < 2e-3, "{}", fit.total_rms());
        assert!(fit.linear.windows(2).all(|w| w[1] > w[0]), "the slope rises with frequency");
        assert!(fit.cubic.iter().all(|c| *c < 0.0), "tanh bends down");
    }
}
