//! Depth error from noise alone, for planned optics. For a texture of power spectrum P and noise variance s^2 in both
//! images (each divided by its mean), no estimator over w x w pixels is below `SD(alpha) = 1 / (w sqrt(J))`. With the
//! transfer functions H1 and H2: `J = mean over frequencies of P D^2 / (s^2 (H1^2 + H2^2))`,
//! `D = H1 dH2/dalpha - H2 dH1/dalpha`. Depth follows with `dz/dalpha`. The methods' excess over this bound was
//! measured on rendered planes.

use farnear_depth::optics::Optics;
use serde::Serialize;

/// Frequencies per axis of the spectrum.
const FREQUENCIES: usize = 64;
const DEPTHS: usize = 9;
/// Variance of a pixel's noise / mean squared: 8 bit, 9,000 electrons, read noise of 12 electrons.
const NOISE_VARIANCE: f64 = 1.19e-4;
/// Default windows on flat surfaces and error / bound. Measured: 1.07 and 1.08 on rendered planes; 1.1 to 1.4 and 1.3 to 1.5
/// on slants through the whole range with four proposed lenses. The larger values are used.
const RATIONAL: Reached = Reached { window_px: 7.0, above_bound: 1.37 };
const WHITENED: Reached = Reached { window_px: 21.0, above_bound: 1.5 };

struct Reached {
    window_px: f64,
    above_bound: f64,
}

/// Root-mean-square depth error over the working range from the camera's noise.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct ExpectedError {
    /// `--method ro`.
    pub ro_mm: f64,
    /// `--method whitened`, on flat surfaces.
    pub whitened_mm: f64,
}

/// For a texture with standard deviation / mean = `contrast`, and `binning` x `binning` sensor pixels per pixel.
pub fn expected_error(optics: &Optics, contrast: f64, binning: usize) -> ExpectedError {
    let otf = optics.psf().otf(1.1 * optics.max_blur_px());
    let noise = NOISE_VARIANCE / (binning * binning) as f64;
    let transfer = |alpha: f64, w: f64| optics.blur_px(alpha).map(|radius| otf.at(radius.abs(), w));
    let spectrum = spectrum(contrast);
    let square = |index: usize| {
        let alpha = -1.0 + 2.0 * index as f64 / (DEPTHS - 1) as f64;
        let information: f64 = spectrum
            .iter()
            .map(|(w, power)| {
                let step = 1e-3;
                let [h1, h2] = transfer(alpha, *w);
                let ([up1, up2], [low1, low2]) = (transfer(alpha + step, *w), transfer(alpha - step, *w));
                let difference = (h1 * (up2 - low2) - h2 * (up1 - low1)) / (2.0 * step);
                power * difference * difference / (noise * (h1 * h1 + h2 * h2).max(1e-9))
            })
            .sum();
        let mm = optics.depth_per_alpha_mm(alpha);
        mm * mm / information
    };
    let of_one_pixel = ((0..DEPTHS).map(square).sum::<f64>() / DEPTHS as f64).sqrt();
    let of = |reached: &Reached| of_one_pixel / reached.window_px * reached.above_bound;
    ExpectedError { ro_mm: of(&RATIONAL), whitened_mm: of(&WHITENED) }
}

/// Radial frequencies (rad/px) and share of the texture's variance: a 1/w spectrum sampled by square pixels.
fn spectrum(contrast: f64) -> Vec<(f64, f64)> {
    let axis = |index: usize| {
        let signed = index as f64 - if index > FREQUENCIES / 2 { FREQUENCIES as f64 } else { 0.0 };
        std::f64::consts::TAU * signed / FREQUENCIES as f64
    };
    let sinc = |w: f64| if w == 0.0 { 1.0 } else { (w / 2.0).sin() / (w / 2.0) };
    let mut all: Vec<(f64, f64)> = (1..FREQUENCIES * FREQUENCIES)
        .map(|index| {
            let (u, v) = (axis(index % FREQUENCIES), axis(index / FREQUENCIES));
            let w = u.hypot(v);
            (w, (sinc(u) * sinc(v)).powi(2) / w)
        })
        .collect();
    let whole: f64 = all.iter().map(|(_, power)| power).sum();
    all.iter_mut().for_each(|(_, power)| *power *= contrast * contrast / whole);
    all
}
