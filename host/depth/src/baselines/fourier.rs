//! Subbarao's method in the Fourier domain (1988; Li 2014, appendix C).
//!
//! In a window of nearly one depth `I1 / I2 = H1 / H2` (eq. C.5; C.4 prints H1 for H2). For a Gaussian PSF that is
//! `ln(|I1| / |I2|) = -(sigma1^2 - sigma2^2) w^2 / 4` with the PSF's second moments (twice the variance of one
//! coordinate): one equation per frequency, solved by energy-weighted least squares. C.1 turns the moments into depth;
//! corrected it reads `sigma = k d s / 2 (1/F - 1/u - 1/s)` (`k` multiplies the blur radius; the printed form lacks
//! `s / 2` and inverts `k`). Every pixel has its own Hann window of 21 px, transformed at twelve frequencies by
//! separable filters. Cost: about 2000 operations a pixel.

use std::f64::consts::TAU;

use ndarray::{Array2, Zip};

use super::common::{Along, Evidence, Pair, filter, window_sum};
use crate::optics::Optics;
use crate::pipeline::Settings;

const WINDOW_PX: usize = 21;

/// Frequencies (columns, rows) in units of 2 pi / 21 rad/px. The Hann window hides a mean from all but the first; at
/// the upper limit, 1.2 rad/px, the stronger blur leaves a quarter.
const FREQUENCIES: [(i32, i32); 12] =
    [(2, 0), (0, 2), (2, 2), (2, -2), (3, 0), (0, 3), (3, 2), (2, 3), (3, -2), (-2, 3), (4, 0), (0, 4)];

pub(super) fn evidence(pair: &Pair, optics: &Optics, settings: &Settings) -> Evidence {
    let dim = pair.far.dim();
    // Sums over frequencies of weight * x^2, weight * x * y and weight * y^2; x = -w^2 / 4, y = ln(|I1| / |I2|).
    let zeros = || Array2::<f32>::zeros(dim);
    let (mut xx, mut xy, mut yy) = (zeros(), zeros(), zeros());
    let mut texture = Array2::<f32>::zeros(dim);
    for (across, down) in FREQUENCIES {
        let energy =
            |image: &Array2<f32>| window_sum(&local_energy(image, across, down), settings.smoothing_px);
        let (far, near) = (energy(&pair.far), energy(&pair.near));
        let w2 = (TAU / WINDOW_PX as f64).powi(2) * f64::from(across * across + down * down);
        let x = (-w2 / 4.0) as f32;
        Zip::from(&mut xx).and(&mut xy).and(&mut yy).and(&far).and(&near).for_each(
            |xx, xy, yy, far, near| {
                if *far > 0.0 && *near > 0.0 {
                    // The variance of a logarithm is inverse to the energy, mainly of the weaker image.
                    let weight = far * near / (far + near);
                    let y = 0.5 * (far / near).ln();
                    *xx += weight * x * x;
                    *xy += weight * x * y;
                    *yy += weight * y * y;
                }
            },
        );
        texture += &far;
        texture += &near;
    }
    let scale = (1.0 / (optics.psf().second_moment() * optics.max_blur_px().powi(2))) as f32;
    let mut alpha = Array2::from_elem(dim, f32::NAN);
    let mut misfit = Array2::zeros(dim);
    Zip::from(&mut alpha).and(&mut misfit).and(&xx).and(&xy).and(&yy).for_each(
        |alpha, misfit, xx, xy, yy| {
            if *xx > 0.0 {
                let slope = xy / xx;
                *alpha = scale * slope;
                *misfit = (scale * scale * (yy / xx - slope * slope)).max(0.0);
            }
        },
    );
    Evidence { alpha, texture, misfit, reach_px: WINDOW_PX / 2 + settings.smoothing_px / 2 }
}

fn local_energy(image: &Array2<f32>, across: i32, down: i32) -> Array2<f32> {
    let [cos_x, sin_x] = taps(across);
    let [cos_y, sin_y] = taps(down);
    let real_x = filter(image, &cos_x, Along::Rows);
    let imaginary_x = filter(image, &sin_x, Along::Rows);
    let down = |image: &Array2<f32>, taps: &[f32]| filter(image, taps, Along::Columns);
    let real = down(&real_x, &cos_y) - down(&imaginary_x, &sin_y);
    let imaginary = down(&real_x, &sin_y) + down(&imaginary_x, &cos_y);
    &real * &real + &imaginary * &imaginary
}

fn taps(index: i32) -> [Vec<f32>; 2] {
    let place = |i: usize| i as f64 - (WINDOW_PX / 2) as f64;
    let hann = |i: usize| 0.5 + 0.5 * (TAU * place(i) / (WINDOW_PX + 1) as f64).cos();
    let phase = |i: usize| TAU * f64::from(index) * place(i) / WINDOW_PX as f64;
    let of = |f: fn(f64) -> f64| (0..WINDOW_PX).map(|i| (hann(i) * f(phase(i))) as f32).collect();
    [of(f64::cos), of(f64::sin)]
}
