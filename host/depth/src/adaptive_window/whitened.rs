//! Operators whose residual is white: no pre-filter, five parallel kernels.
//!
//! With `m = I1 - I2` and `p = I1 + I2` (I1 far-focused) the residual of a depth is
//! `r = R0 * m + alpha R1 * p + alpha^2 R2 * m + alpha^3 R3 * p`. A texture F gives `(A H1 - B H2) F` with
//! `A = sum alpha^k R_k`, `B = sum (-alpha)^k R_k`. It vanishes at the true depth for `A : B = H2 : H1`; noise stays
//! white with unit gain for `A^2 + B^2 = 1`. A linear least squares approximates both within 7x7 taps; a second one
//! designs `U0 * p + alpha U1 * m`, the matched filter for the residual's change with depth, under the exact constraint that
//! noise, which enters both, does not bias `sum r u`. Only `u = U0 * p` is used. What noise adds to `sum r u` without U1 is
//! removed from the sums (`Bank::of_noise`).
//!
//! A window of side w has a standard deviation within 6 % of the bound for unknown texture (`docs/method.md`):
//! `1 / (w sqrt J)`, `J = mean over frequencies of P D^2 / (s^2 (H1^2 + H2^2))`, `D = H1 H2' - H2 H1'`, P the texture's
//! power, s^2 the noise's. Cost of [`Whitened::design`]: 153 frequencies x 13 depths, 40 unknowns, 1 to 2 ms; at run time
//! five 7x7 kernels.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use crate::kernel::{self, Kernel};
use crate::normalised_ratio::{GridPoint, octant};
use crate::operators::{DesignError, least_squares};
use crate::optics::Optics;
use crate::psf::{Otf, Psf};

pub(crate) const SIZE: usize = 7;
/// Depths sampled by the design, 0 to 1.1. Those from -1.1 to 0 have the same equations: far and near change places.
const ALPHAS: usize = 13;
const REACH: f64 = 1.1;
/// Design variance of the noise relative to the mean brightness: 9,000 electrons, read noise 12 electrons.
const NOISE: f64 = 1.19e-4;
const CONTRAST: f64 = 0.025;
/// Weight of the nulled texture against the whiteness of the noise.
const NULLING: f64 = 1.92e8;
const RIDGE: f64 = 1e-6;
const STEP: f64 = 1e-4;

/// The five kernels for given optics.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitened {
    pub(crate) residual: [Kernel; 4],
    pub(crate) matched: Kernel,
    /// `sum (R1 p) u` over `sum u^2` at alpha = 0, for the design's texture and noise.
    pub(crate) slope_in_energy: f64,
    /// Variance of alpha, in energies / slope^2, for noise of unit variance: a polynomial in alpha^2.
    pub(crate) variance_gain: [f32; 4],
}

struct Point {
    at: GridPoint,
    power: f64,
    basis: Vec<f64>,
}

struct Sample {
    alpha: f64,
    /// 2 if it also counts for `-alpha`.
    multiplicity: f64,
    h: [f64; 2],
    q: f64,
    turn: f64,
}

impl Whitened {
    /// Designs the kernels. Returns [`DesignError`] if a least squares is singular or the PSF is invalid.
    pub fn design(optics: &Optics) -> Result<Self, DesignError> {
        let floor_px = optics.stage().map_or(0.0, |stage| stage.blur_floor_px);
        Self::for_psf(optics.psf(), optics.max_blur_px(), floor_px)
    }

    fn for_psf(psf: Psf, max_blur_px: f64, floor_px: f64) -> Result<Self, DesignError> {
        let otf = psf.checked()?.otf((1.2 * max_blur_px).hypot(floor_px));
        let points = points();
        let alphas: [f64; ALPHAS] = std::array::from_fn(|i| REACH * i as f64 / (ALPHAS - 1) as f64);
        let sampled =
            |point: &Point| alphas.map(|alpha| sample(&otf, [max_blur_px, floor_px], point.at.w, alpha));
        let samples: Vec<[Sample; ALPHAS]> = points.iter().map(sampled).collect();
        let residual = residual(&points, &samples)?;
        let matched = matched(&points, &samples, &residual)?;
        let slope_in_energy = slope_in_energy(&points, &samples, &residual, &matched);
        let variance_gain = variance_gain(&points, &samples, &residual, &matched)?;
        Ok(Self { residual, matched, slope_in_energy, variance_gain })
    }
}

fn points() -> Vec<Point> {
    let grid = octant();
    let floor = 2.0 * PI / 64.0;
    let spectrum = |w: f64| 1.0 / w.max(floor);
    let total: f64 = grid.iter().map(|p| p.multiplicity).sum();
    let mean = grid.iter().map(|p| p.multiplicity * spectrum(p.w)).sum::<f64>() / total;
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    grid.into_iter()
        .map(|at| {
            let pixel = (sinc(0.5 * at.u) * sinc(0.5 * at.v)).powi(2);
            let power = CONTRAST * CONTRAST * spectrum(at.w) * pixel / mean;
            Point { at, power, basis: kernel::basis_responses(SIZE, at.u, at.v) }
        })
        .collect()
}

fn sample(otf: &Otf, [max_blur_px, floor_px]: [f64; 2], w: f64, alpha: f64) -> Sample {
    let both = |alpha: f64| {
        [1.0 + alpha, 1.0 - alpha].map(|factor| otf.at((0.5 * factor * max_blur_px).hypot(floor_px), w))
    };
    let h = both(alpha);
    let (above, below) = (both(alpha + STEP), both(alpha - STEP));
    let slope = |i: usize| (above[i] - below[i]) / (2.0 * STEP);
    let multiplicity = if alpha > 0.0 { 2.0 } else { 1.0 };
    Sample { alpha, multiplicity, h, q: h[0] * h[0] + h[1] * h[1], turn: h[0] * slope(1) - h[1] * slope(0) }
}

/// The `x` that minimises `|rows x - right|^2` with every constraint's product with `x` exactly 0.
fn constrained(rows: &[(Vec<f64>, f64)], constraints: &[Vec<f64>]) -> Result<DVector<f64>, DesignError> {
    let unknowns = rows[0].0.len();
    let singular = DesignError::Singular { unknowns };
    let square = DMatrix::from_fn(unknowns, unknowns, |i, j| constraints.get(i).map_or(0.0, |c| c[j]));
    let svd = square.svd(false, true);
    let directions = svd.v_t.ok_or(singular)?;
    let least = 1e-9 * svd.singular_values.max();
    let free: Vec<usize> = (0..unknowns).filter(|i| svd.singular_values[*i] <= least).collect();
    let space = DMatrix::from_fn(unknowns, free.len(), |i, j| directions[(free[j], i)]);
    let (matrix, right) = least_squares::reduced(rows);
    Ok(&space * least_squares::solve(matrix * &space, right)?)
}

/// One unit row per unknown: keeps undetermined unknowns small.
fn ridge(unknowns: usize) -> impl Iterator<Item = (Vec<f64>, f64)> {
    (0..unknowns).map(move |i| {
        let mut row = vec![0.0; unknowns];
        row[i] = RIDGE.sqrt();
        (row, 0.0)
    })
}

fn at_zero() -> Vec<f64> {
    kernel::basis_responses(SIZE, 0.0, 0.0)
}

/// R0 to R3: texture nulled at its depth, noise white and of unit gain.
fn residual(points: &[Point], samples: &[[Sample; ALPHAS]]) -> Result<[Kernel; 4], DesignError> {
    let n = kernel::free_coefficients(SIZE);
    let mut rows = Vec::with_capacity(4 * points.len() + 4 * n);
    for (point, samples) in points.iter().zip(samples) {
        let mut equations = Vec::with_capacity(3 * ALPHAS);
        for s in samples {
            let wiener = point.power * s.q / (point.power * s.q + NOISE);
            let powers: [f64; 4] = std::array::from_fn(|k| s.alpha.powi(k as i32));
            let signs = [1.0, -1.0, 1.0, -1.0];
            let mut equation = |factor: &dyn Fn(usize) -> f64, weight: f64, right: f64| {
                let weight = (point.at.multiplicity * s.multiplicity * weight).sqrt();
                equations.push(((0..4).map(|k| weight * factor(k)).collect::<Vec<f64>>(), weight * right));
            };
            let root = s.q.sqrt().max(1e-9);
            let nulled = |k: usize| powers[k] * (s.h[0] - signs[k] * s.h[1]);
            equation(&nulled, NULLING * point.power * (wiener + 1e-3), 0.0);
            equation(&|k| powers[k], wiener + 0.05, s.h[1] / root);
            equation(&|k| signs[k] * powers[k], wiener + 0.05, s.h[0] / root);
        }
        rows.extend(least_squares::in_taps(&equations, &point.basis));
    }
    rows.extend(ridge(4 * n));
    // R1 and R3 act on the sum, whose mean carries no depth.
    let constraints: Vec<Vec<f64>> = [1, 3]
        .map(|k| {
            let mut all = vec![0.0; 4 * n];
            all[k * n..(k + 1) * n].copy_from_slice(&at_zero());
            all
        })
        .to_vec();
    let taps = constrained(&rows, &constraints)?;
    Ok(Kernel::several(SIZE, taps.as_slice())?)
}

fn matched(
    points: &[Point],
    samples: &[[Sample; ALPHAS]],
    residual: &[Kernel; 4],
) -> Result<Kernel, DesignError> {
    let n = kernel::free_coefficients(SIZE);
    let mut rows = Vec::with_capacity(2 * points.len() + 2 * n);
    for (point, samples) in points.iter().zip(samples) {
        let responses = [0, 1, 2, 3].map(|k| residual[k].response(point.at.u, point.at.v));
        let mut equations = Vec::with_capacity(2 * ALPHAS);
        for s in samples {
            let sum = |sign: f64| (0..4).map(|k| (sign * s.alpha).powi(k as i32) * responses[k]).sum::<f64>();
            let gain = sum(1.0).hypot(sum(-1.0)).max(0.15);
            let energy = point.power * s.q + NOISE;
            let target = s.turn * point.power / (s.q.sqrt().max(1e-9) * energy * gain);
            let weight = (point.at.multiplicity * s.multiplicity * energy).sqrt();
            for (h, sign) in s.h.iter().zip([1.0, -1.0]) {
                equations.push((vec![weight, weight * sign * s.alpha], weight * h * target));
            }
        }
        rows.extend(least_squares::in_taps(&equations, &point.basis));
    }
    rows.extend(ridge(2 * n));
    let taps: Vec<f64> = kernel::offsets(SIZE).map(kernel::taps).collect();
    let product =
        |kernel: &Kernel| kernel.octant().iter().zip(&taps).map(|(c, t)| c * t).collect::<Vec<f64>>();
    let [r0, r1, r2, r3] = residual.each_ref().map(product);
    let constraints =
        [[at_zero(), vec![0.0; n]], [r1, r0], [r3, r2]].map(|[own, with_alpha]| [own, with_alpha].concat());
    let both = constrained(&rows, &constraints)?;
    Ok(Kernel::new(SIZE, both.as_slice()[..n].to_vec())?)
}

fn slope_in_energy(
    points: &[Point],
    samples: &[[Sample; ALPHAS]],
    residual: &[Kernel; 4],
    matched: &Kernel,
) -> f64 {
    let [mut slope, mut energy] = [0.0; 2];
    for (point, samples) in points.iter().zip(samples) {
        let s = &samples[0];
        let of_sum = point.power * (s.h[0] + s.h[1]).powi(2) + 2.0 * NOISE;
        let [r1, u] = [&residual[1], matched].map(|kernel| kernel.response(point.at.u, point.at.v));
        slope += point.at.multiplicity * of_sum * r1 * u;
        energy += point.at.multiplicity * of_sum * u * u;
    }
    slope / energy
}

/// The residual's noise power, weighed by the power of the matched filter's output for a texture of even power. A sum of
/// products of both has this variance (Parseval), however their neighbouring pixels correlate.
fn variance_gain(
    points: &[Point],
    samples: &[[Sample; ALPHAS]],
    residual: &[Kernel; 4],
    matched: &Kernel,
) -> Result<[f32; 4], DesignError> {
    let responses: Vec<([f64; 4], f64)> = points
        .iter()
        .map(|p| (residual.each_ref().map(|r| r.response(p.at.u, p.at.v)), matched.response(p.at.u, p.at.v)))
        .collect();
    let rows: Vec<(Vec<f64>, f64)> = (0..ALPHAS)
        .map(|index| {
            let alpha = samples[0][index].alpha;
            let [mut of_noise, mut of_texture] = [0.0; 2];
            for ((point, samples), (r, u)) in points.iter().zip(samples).zip(&responses) {
                let sum = |sign: f64| (0..4).map(|k| (sign * alpha).powi(k as i32) * r[k]).sum::<f64>();
                let h = samples[index].h;
                let power = point.power * point.at.w;
                let texture = u * u * (power * (h[0] + h[1]).powi(2) + 2.0 * NOISE);
                of_noise += point.at.multiplicity * texture * (sum(1.0).powi(2) + sum(-1.0).powi(2));
                of_texture += point.at.multiplicity * texture;
            }
            ((0..4).map(|k| alpha.powi(2 * k)).collect(), of_noise / of_texture)
        })
        .collect();
    let (matrix, right) = least_squares::reduced(&rows);
    let found = least_squares::solve(matrix, right)?;
    Ok(std::array::from_fn(|k| found[k] as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_taps_are_those_of_the_study() {
        let found = Whitened::for_psf(Psf::Gaussian { k: 0.4578 }, 2.703, 0.0).unwrap();
        let printed = [
            [0.29505, 0.09289, 0.04108, 0.00455, 0.00016, 0.00095],
            [0.42695, -0.01821, -0.03542, -0.0235, -0.01588, 0.00177],
            [0.3486, -0.07267, -0.03864, -0.00006, 0.00508, 0.00769],
            [0.11388, -0.03253, -0.01125, 0.00508, 0.00555, 0.00225],
            [0.08598, 0.06249, -0.01227, -0.03651, -0.01925, -0.0055],
        ];
        let kernels = found.residual.iter().chain([&found.matched]);
        for (kernel, printed) in kernels.zip(printed) {
            for (tap, expected) in kernel.octant().iter().zip(printed) {
                assert!((tap - expected).abs() < 2e-4, "{:?} {printed:?}", kernel.octant());
            }
        }
        assert!((found.slope_in_energy - 1.434).abs() < 0.02, "{}", found.slope_in_energy);
    }

    #[test]
    fn noise_does_not_bias_and_the_mean_has_no_effect() {
        for psf in [Psf::PillBox, Psf::Gaussian { k: 0.4578 }, Psf::Generalised { p: 1.8, k: 0.4802 }] {
            let found = Whitened::for_psf(psf, 2.703, 0.0).unwrap();
            let [_, r1, _, r3] = &found.residual;
            for kernel in [r1, r3, &found.matched] {
                assert!(kernel.response(0.0, 0.0).abs() < 1e-9, "{psf}");
            }
        }
    }
}
