//! Focus position from the spectra of three blurred images.
//!
//! Blur of standard deviation `s` pixels multiplies the power at frequency `w` by `exp(-s^2 w^2)`, with
//! `s = k e / (2 Fe d)` at the distance `e` from focus (`d` = pixel pitch). The log ratio of two images' power is
//! therefore linear in `w^2`, independent of texture: `ln(Pi / Pj) = -(k / (2 Fe d))^2 (ei^2 - ej^2) w^2`. With both
//! positions known, the slope gives `e` (after Subbarao). Other PSFs agree while blur is small against `1 / w`: higher
//! frequencies are excluded. A wrong `k` only changes the next step's length. Cost: one FFT of the binned image.

use farnear_depth::fourier::{Complex64, transform};
use ndarray::Array2;

/// Binning: the used frequencies are below a quarter of the sampling rate.
const BIN: usize = 2;
/// Spectral rings, from 0 to the binned image's highest frequency.
const RINGS: usize = 48;
/// The first rings contain shading and its leakage.
const FIRST_RING: usize = 2;
/// Rings below this multiple of the noise are ignored.
const ABOVE_NOISE: f64 = 3.0;
/// Larger log ratios may be beyond the first zero of a PSF that is not Gaussian.
const SMALL_RATIO: f64 = 1.0;
/// Rings that contain only noise in a blurred image.
const NOISE_RINGS: usize = 8;

#[derive(Clone, PartialEq, Debug)]
pub(super) struct Spectrum {
    /// Coarse plus fine position, nm.
    pub place: f64,
    power: [f64; RINGS],
    count: [f64; RINGS],
}

/// Rad per original pixel.
fn frequency(ring: usize) -> f64 {
    (ring as f64 + 0.5) / RINGS as f64 * std::f64::consts::PI / BIN as f64
}

impl Spectrum {
    /// At least 16 x 16 px.
    pub(super) fn of(image: &Array2<f32>, place: f64) -> Self {
        let mut binned = super::binned(image, BIN);
        let (height, width) = binned.dim();
        let mean = binned.mean().unwrap_or(0.0);
        let window = |at: usize, length: usize| {
            (std::f32::consts::PI * (at as f32 + 0.5) / length as f32).sin().powi(2)
        };
        for ((row, column), value) in binned.indexed_iter_mut() {
            *value = (*value - mean) * window(row, height) * window(column, width);
        }
        let spectrum = transform(binned.mapv(|value| Complex64::new(f64::from(value), 0.0)));
        let (mut power, mut count) = ([0.0; RINGS], [0.0; RINGS]);
        let signed = |at: usize, length: usize| (if at > length / 2 { length - at } else { at }) as f64;
        for ((row, column), value) in spectrum.indexed_iter() {
            let (y, x) = (signed(row, height) / height as f64, signed(column, width) / width as f64);
            // 0.5 cycles a pixel is the highest frequency along an axis.
            let ring = (2.0 * x.hypot(y) * RINGS as f64) as usize;
            if ring < RINGS {
                power[ring] += value.norm_sqr();
                count[ring] += 1.0;
            }
        }
        power.iter_mut().zip(&count).for_each(|(power, count)| *power /= f64::max(*count, 1.0));
        Self { place, power, count }
    }

    fn noise(&self) -> f64 {
        self.power[RINGS - NOISE_RINGS..].iter().sum::<f64>() / NOISE_RINGS as f64
    }
}

/// Focus position in nm; `None` for noise only or equal positions. `blur_per_nm`: blur SD in px per nm of defocus.
pub(super) fn estimate(images: &[Spectrum], blur_per_nm: f64) -> Option<f64> {
    let noise = images.iter().map(Spectrum::noise).fold(f64::INFINITY, f64::min);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (at, one) in images.iter().enumerate() {
        for other in &images[at + 1..] {
            let apart = one.place - other.place;
            if let Some(slope) = slope(one, other, noise).filter(|_| apart != 0.0) {
                let focus = (one.place + other.place) / 2.0 + slope / (2.0 * blur_per_nm.powi(2) * apart);
                sum += focus * apart * apart;
                weights += apart * apart;
            }
        }
    }
    (weights > 0.0).then(|| sum / weights)
}

/// Slope of the log power ratio against the squared frequency, by weighted least squares through 0.
fn slope(one: &Spectrum, other: &Spectrum, noise: f64) -> Option<f64> {
    let (mut xy, mut xx) = (0.0, 0.0);
    for ring in FIRST_RING..RINGS {
        let [a, b] = [one, other].map(|spectrum| spectrum.power[ring] - noise);
        if a.min(b) < (ABOVE_NOISE - 1.0) * noise || a.min(b) <= 0.0 {
            continue;
        }
        let ratio = (a / b).ln();
        if ratio.abs() > SMALL_RATIO && xx > 0.0 {
            break;
        }
        let x = frequency(ring).powi(2);
        // The logarithm's uncertainty is that of noise relative to power.
        let weight = one.count[ring] * (a.min(b) / (a.min(b) + noise)).powi(2);
        xy += weight * x * ratio;
        xx += weight * x * x;
    }
    (xx > 0.0).then(|| xy / xx)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(blur_px: f64) -> Array2<f32> {
        let waves: Vec<(f64, f64, f64)> = (1..120)
            .map(|i| {
                let (i, turn) = (f64::from(i), f64::from(i) * 2.399_963);
                let frequency = 0.03 + 0.012 * i;
                (frequency * turn.cos(), frequency * turn.sin(), i * i)
            })
            .collect();
        Array2::from_shape_fn((160, 192), |(row, column)| {
            let sum: f64 = waves
                .iter()
                .map(|(fy, fx, phase)| {
                    let damped = (-0.5 * blur_px.powi(2) * (fx * fx + fy * fy)).exp();
                    damped * (fy * row as f64 + fx * column as f64 + phase).sin()
                })
                .sum();
            (100.0 + 6.0 * sum).round() as f32 // in whole codes: quantisation is the noise here
        })
    }

    #[test]
    fn three_blurred_images_locate_the_focus() {
        // k / (2 Fe d) of the rig's optics: 0.4578 / (2 * 3.90625 * 7400 nm).
        let blur_per_nm = 0.4578 / (2.0 * 3.90625 * 7400.0);
        for focus in [-1_000e3, -400e3, -60e3, 0.0, 250e3, 800e3] {
            let images: Vec<Spectrum> = [-95e3, 0.0, 95e3]
                .map(|place: f64| Spectrum::of(&texture(blur_per_nm * (place - focus).abs()), place))
                .into();
            let found = estimate(&images, blur_per_nm).expect("an estimate");
            // A quarter of the way from afar, and well inside the fine sweep nearby.
            assert!((found - focus).abs() < 0.25 * f64::abs(focus) + 15e3, "{focus}: {found}");
        }
    }

    #[test]
    fn noise_alone_gives_no_estimate() {
        let flat = Array2::from_elem((64, 64), 7.0);
        let images: Vec<Spectrum> = [0.0, 1.0].map(|place| Spectrum::of(&flat, place)).into();
        assert_eq!(estimate(&images, 1e-6), None);
        assert_eq!(estimate(&images[..1], 1e-6), None);
    }
}
