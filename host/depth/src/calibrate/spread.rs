//! Standard errors of a PSF, and whether it explains the pairs.
//!
//! `(h1, h2)` is the OTF at both blur radii and `v` its direction. A ring's information on a parameter is the signal
//! along `v` times `g^2`, `g = (h2 dh1 - h1 dh2) / (h1^2 + h2^2)`; the residual per coefficient is the noise.
//! Covariances are `A^-1 B A^-1` of these (the residual may exceed noise, and noise times noise counts where the signal
//! is weak), times the number of coefficients that vary together under a Hann window.

use nalgebra::{DMatrix, DVector};

use super::search::Observation;
use crate::psf::{Otf, Psf};

/// Coefficients that vary together under the square of a Hann window: `n sum w^4 / (sum w^2)^2 = 35/18` per axis.
pub(super) const TOGETHER: f64 = (35.0 / 18.0) * (35.0 / 18.0);

/// Coefficients of a band in the search for noise: some bands have no lighting or aliases. Chance lowers noise by 5 %.
const QUIET_BAND: f64 = 1500.0;

pub(super) struct Seen {
    /// `-h2, h1` over its length, times the images: the residual, squared and summed.
    pub left: f64,
    /// The product of that with the signal along `v`.
    pub mixed: f64,
    /// The signal along `v`, squared and summed, noise included.
    pub signal: f64,
    pub count: f64,
}

pub(super) fn seen(ring: &super::spectra::Ring, [h1, h2]: [f64; 2]) -> Seen {
    let norm = (h1 * h1 + h2 * h2).max(1e-12);
    let (far, near, cross) = (ring.far / norm, ring.near / norm, ring.cross / norm);
    Seen {
        left: h2 * h2 * far - 2.0 * h1 * h2 * cross + h1 * h1 * near,
        mixed: h1 * h2 * (near - far) + (h1 * h1 - h2 * h2) * cross,
        signal: h1 * h1 * far + 2.0 * h1 * h2 * cross + h2 * h2 * near,
        count: ring.count,
    }
}

/// Derivative of the direction `(-h2, h1)` by a parameter with the OTF derivatives `[d1, d2]`.
pub(super) fn turn([h1, h2]: [f64; 2], [d1, d2]: [f64; 2]) -> f64 {
    (h2 * d1 - h1 * d2) / (h1 * h1 + h2 * h2).max(1e-12)
}

/// Mean square noise of a coefficient: the least over bands of what no round PSF explains.
pub(super) fn noise(observations: &[Observation]) -> f64 {
    let mut least = f64::INFINITY;
    for (bins, _) in observations {
        let whole = bins.coefficients();
        let (mut left, mut count) = (0.0, 0.0);
        for ring in &bins.rings {
            // The smaller eigenvalue of the ring's sums; the larger contains some of the noise.
            let half = 0.5 * (ring.far - ring.near);
            let smaller = (0.5 * (ring.far + ring.near) - half.hypot(ring.cross)).max(0.0);
            let independent = (ring.count / TOGETHER).max(1.5);
            left += smaller * independent / (independent - 1.0);
            count += ring.count;
            // A last band of too few coefficients is ignored.
            if count >= QUIET_BAND.min(0.5 * whole) {
                least = least.min(left / count);
                (left, count) = (0.0, 0.0);
            }
        }
    }
    if least.is_finite() { least } else { 0.0 }
}

/// Covariance of parameters: `at` gives the OTF and its derivatives for a radius and a frequency.
pub(super) fn covariance(
    observations: &[Observation],
    parameters: usize,
    prior: Option<&DMatrix<f64>>,
    at: impl Fn(f64, f64) -> (f64, Vec<f64>),
) -> Option<DMatrix<f64>> {
    let mut rings = Vec::new();
    let (mut left, mut count) = (0.0, 0.0);
    for (bins, [far_px, near_px]) in observations {
        for ring in &bins.rings {
            let [(h1, d1), (h2, d2)] = [far_px, near_px].map(|radius| at(*radius, ring.frequency));
            let seen = seen(ring, [h1, h2]);
            (left, count) = (left + seen.left, count + seen.count);
            rings.push((seen, DVector::from_fn(parameters, |i, _| turn([h1, h2], [d1[i], d2[i]]))));
        }
    }
    let variance = left / count;
    let mut bread = DMatrix::<f64>::zeros(parameters, parameters);
    let mut filling = bread.clone();
    for (seen, turn) in rings {
        let outer = &turn * turn.transpose();
        let of_signal = (seen.signal - variance * seen.count).max(0.0);
        bread += &outer * of_signal;
        filling += outer * (TOGETHER * variance * seen.signal);
    }
    if let Some(prior) = prior {
        let weight = TOGETHER * variance;
        bread += prior * weight;
        filling += prior * (weight * weight);
    }
    let inverse = bread.cholesky()?.inverse();
    Some(&inverse * filling * &inverse)
}

/// Standard errors of a model's parameters, `k` or `p` and `k`; none for PSFs without.
pub(super) fn of_parameters(observations: &[Observation], psf: Psf) -> Option<Vec<f64>> {
    const STEP: f64 = 1e-3;
    let more = |value: f64| value * (1.0 + STEP);
    let others = match psf {
        Psf::Gaussian { k } => vec![(STEP * k, Psf::Gaussian { k: more(k) })],
        Psf::Generalised { p, k } => vec![
            (STEP * p, Psf::Generalised { p: more(p), k }),
            (STEP * k, Psf::Generalised { p, k: more(k) }),
        ],
        Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_) => return None,
    };
    let largest = observations.iter().flat_map(|(_, radii)| radii).fold(0.0_f64, |a, r| a.max(r.abs()));
    let here = psf.otf(largest);
    let there: Vec<(f64, Otf)> = others.iter().map(|(step, psf)| (*step, psf.otf(largest))).collect();
    let found = covariance(observations, there.len(), None, |radius, frequency| {
        let h = here.at(radius, frequency);
        (h, there.iter().map(|(step, otf)| (otf.at(radius, frequency) - h) / step).collect())
    })?;
    Some((0..there.len()).map(|i| found[(i, i)].max(0.0).sqrt()).collect())
}
