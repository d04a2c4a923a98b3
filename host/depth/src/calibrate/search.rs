//! The searches for `k`, and for `p` and `k`.

use super::{CalibrationError, spectra::Bins};
use crate::psf::{Otf, Psf};

/// Limits of `k`: the scale of a PSF is of the order of its blur radius.
const K: [f64; 2] = [0.05, 2.0];

/// Limits of `p`: see [`Psf::checked`].
const P: [f64; 2] = [0.5, 64.0];

/// Trials of `k` before the refinement, in equal ratios (8 %).
const TRIALS: usize = 48;

/// Start of the search for `p` (Li 2014, section 5.2.2), in steps of 6 %: the thesis' 0.1 near p = 1.8.
const FIRST_P: f64 = 1.0;
const P_RATIO: f64 = 1.06;

/// A pair's rings and its images' blur radii, px.
pub(super) type Observation = (Bins, [f64; 2]);

/// `sum |H1 I2 - H2 I1|^2 / (H1^2 + H2^2)`; `scale` multiplies the blur radii.
fn cost(observations: &[Observation], otf: &Otf, scale: f64) -> f64 {
    let of_pair = |(bins, [far_px, near_px]): &Observation| -> f64 {
        let of_ring = bins.rings.iter().map(|ring| {
            let [h1, h2] = [far_px, near_px].map(|radius| otf.at(scale * radius, ring.frequency));
            let norm = h1 * h1 + h2 * h2;
            if norm < 1e-12 {
                return ring.far + ring.near;
            }
            (h1 * h1 * ring.near - 2.0 * h1 * h2 * ring.cross + h2 * h2 * ring.far) / norm
        });
        of_ring.sum()
    };
    observations.iter().map(of_pair).sum()
}

/// Minimum of `f` on a geometric grid, refined by golden sections: place, value, and whether it is at an end.
fn minimise([low, high]: [f64; 2], trials: usize, f: impl Fn(f64) -> f64) -> (f64, f64, bool) {
    let ratio = (high / low).powf(1.0 / (trials - 1) as f64);
    let values: Vec<f64> = (0..trials).map(|i| f(low * ratio.powi(i as i32))).collect();
    let least = (0..trials).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
    let place = low * ratio.powi(least as i32);
    let (place, value) = golden([place / ratio, place * ratio], &f);
    (place, value, least == 0 || least == trials - 1)
}

fn golden([low, high]: [f64; 2], f: impl Fn(f64) -> f64) -> (f64, f64) {
    let part = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (low.ln(), high.ln());
    let inner = |a: f64, b: f64| [b - part * (b - a), a + part * (b - a)];
    let [mut c, mut d] = inner(a, b);
    let (mut fc, mut fd) = (f(c.exp()), f(d.exp()));
    while b - a > 1e-7 {
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = inner(a, b)[0];
            fc = f(c.exp());
        } else {
            (a, c, fc) = (c, d, fd);
            d = inner(a, b)[1];
            fd = f(d.exp());
        }
    }
    if fc < fd { (c.exp(), fc) } else { (d.exp(), fd) }
}

pub(super) fn gaussian(observations: &[Observation]) -> Result<(f64, f64), CalibrationError> {
    let (k, value, at_end) = minimise(K, TRIALS, |k| cost(observations, &Otf::Gaussian { k }, 1.0));
    if at_end {
        return Err(CalibrationError::AtSearchEnd { parameter: "k", value: k });
    }
    Ok((k, value))
}

pub(super) fn generalised(observations: &[Observation]) -> Result<(Psf, f64), CalibrationError> {
    let radii = observations.iter().flat_map(|(_, radii)| radii.iter().map(|r| r.abs()));
    let largest_px = radii.fold(0.0, f64::max);
    let frequency = observations.iter().flat_map(|(bins, _)| bins.rings.iter().map(|r| r.frequency));
    let largest_phase = K[1] * largest_px * frequency.fold(0.0, f64::max);
    // One table per p: k multiplies the blur radii.
    let best_k = |p: f64| {
        let otf = Psf::Generalised { p, k: 1.0 }.otf_up_to(largest_phase);
        minimise(K, TRIALS, |k| cost(observations, &otf, k))
    };
    let (mut best_p, mut best) = (FIRST_P, best_k(FIRST_P).1);
    for ratio in [P_RATIO, 1.0 / P_RATIO] {
        // Five rising steps in a row exclude a ripple.
        let (mut p, mut rising) = (FIRST_P, 0);
        while rising < 5 && (P[0]..=P[1]).contains(&(p * ratio)) {
            p *= ratio;
            let value = best_k(p).1;
            if value < best {
                (best_p, best, rising) = (p, value, 0);
            } else {
                rising += 1;
            }
        }
    }
    if best_p / P_RATIO < P[0] {
        return Err(CalibrationError::AtSearchEnd { parameter: "p", value: best_p });
    }
    // At the upper end the profile is a pill-box.
    let p = if best_p * P_RATIO > P[1] { best_p } else { parabola(best_p, |p| best_k(p).1) };
    let (k, value, at_end) = best_k(p);
    if at_end {
        return Err(CalibrationError::AtSearchEnd { parameter: "k", value: k });
    }
    Ok((Psf::Generalised { p, k }, value))
}

fn parabola(best: f64, f: impl Fn(f64) -> f64) -> f64 {
    let [before, here, after] = [best / P_RATIO, best, best * P_RATIO].map(f);
    let curvature = before - 2.0 * here + after;
    if curvature <= 0.0 {
        return best;
    }
    let shift = (0.5 * (before - after) / curvature).clamp(-1.0, 1.0);
    best * P_RATIO.powf(shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_a_function_is_found() {
        let (place, value, at_end) = minimise([0.05, 2.0], 48, |k| (k - 0.4578).powi(2) + 3.0);
        assert!((place - 0.4578).abs() < 1e-6 && (value - 3.0).abs() < 1e-12 && !at_end);
        assert!(minimise([0.05, 2.0], 48, |k| k).2);
        assert!(minimise([0.05, 2.0], 48, |k| -k).2);
    }

    #[test]
    fn a_parabola_is_met_exactly() {
        let p = parabola(1.8, |p| (p.ln() - 1.83_f64.ln()).powi(2));
        assert!((p - 1.83).abs() < 1e-9, "{p}");
    }
}
