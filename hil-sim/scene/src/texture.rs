//! Random textures: a Gaussian random field of a given spectrum with two samples per pixel, mean 1, standard
//! deviation = contrast, clipped to 0.2..1.8. Its period exceeds the image by at least 64 px, so nothing
//! repeats. Depends on seed and image size only. Cost: one FFT of the period, 0.1 s for 640 x 480.

use std::fmt;

use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rustfft::num_complex::Complex32;

use crate::fourier::{Fourier2, good_size};
use crate::kernel::CELLS_PER_PIXEL;
use crate::maps::Picture;

const MARGIN_PX: usize = 64;
const CLIP: (f32, f32) = (0.2, 1.8);

/// Texture of a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Texture {
    /// White noise blurred by a Gaussian of SD 0.5 px, plus 1/f noise (0.954 and 0.3 of the SD).
    Sand,
    /// Amplitude 1/f, flat below one cycle per 64 px.
    Fractal,
    /// Picture, stretched over the image, mirrored outside.
    Picture(Picture),
}

impl fmt::Display for Texture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sand => "sand",
            Self::Fractal => "fractal",
            Self::Picture(_) => "picture",
        })
    }
}

fn fractal_amplitude(f: f32) -> f32 {
    1.0 / f.max(1.0 / 64.0)
}

fn grain_amplitude(f: f32) -> f32 {
    let z = std::f32::consts::TAU * f * 0.5;
    libm::expf(-0.5 * z * z)
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Spectrum {
    Sand,
    Fractal,
}

impl Spectrum {
    /// One period in cells (half pixels) for an image of this size.
    pub(crate) fn synthesise(
        self,
        width_px: usize,
        height_px: usize,
        contrast: f64,
        seed: u64,
    ) -> Array2<f32> {
        let period = |pixels: usize| good_size((pixels + MARGIN_PX) * CELLS_PER_PIXEL);
        let (height, width) = (period(height_px), period(width_px));
        let amplitude = self.amplitudes(height, width);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // The real part of independent complex coefficients is a real Gaussian field of that spectrum.
        let mut field: Vec<Complex32> = amplitude
            .iter()
            .map(|amplitude| {
                let (re, im): (f32, f32) = (random.sample(StandardNormal), random.sample(StandardNormal));
                Complex32::new(re, im) * amplitude
            })
            .collect();
        Fourier2::new(height, width).inverse(&mut field);
        let count = (height * width) as f64;
        let mean = field.iter().map(|value| f64::from(value.re)).sum::<f64>() / count;
        let variance = field.iter().map(|value| (f64::from(value.re) - mean).powi(2)).sum::<f64>() / count;
        let scale = contrast / variance.sqrt();
        Array2::from_shape_fn((height, width), |(row, column)| {
            let deviation = (f64::from(field[row * width + column].re) - mean) * scale;
            (1.0 + deviation as f32).clamp(CLIP.0, CLIP.1)
        })
    }

    /// Amplitude of each coefficient of the period's DFT; 0 at DC.
    fn amplitudes(self, height: usize, width: usize) -> Array2<f32> {
        let frequency = |index: usize, size: usize| {
            let signed = if index > size / 2 { index as f32 - size as f32 } else { index as f32 };
            signed / size as f32 * CELLS_PER_PIXEL as f32
        };
        let field = |amplitude: fn(f32) -> f32| {
            let mut field = Array2::from_shape_fn((height, width), |(row, column)| {
                let (y, x) = (frequency(row, height), frequency(column, width));
                amplitude((x * x + y * y).sqrt())
            });
            field[[0, 0]] = 0.0;
            field
        };
        match self {
            Self::Fractal => field(fractal_amplitude),
            Self::Sand => {
                let (grain, fractal) = (field(grain_amplitude), field(fractal_amplitude));
                let power = |field: &Array2<f32>| field.iter().map(|a| f64::from(a * a)).sum::<f64>();
                let grain_share = (0.954f64.powi(2) / power(&grain)) as f32;
                let fractal_share = (0.3f64.powi(2) / power(&fractal)) as f32;
                let mut sum = grain;
                // Independent fields add in power.
                sum.zip_mut_with(&fractal, |g, f| {
                    *g = (grain_share * *g * *g + fractal_share * f * f).sqrt()
                });
                sum
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean power of the field per band of frequency (cycles per px), along the rows.
    fn row_power(field: &Array2<f32>, frequency: f64) -> f64 {
        let (height, width) = field.dim();
        let index = (frequency * width as f64 / CELLS_PER_PIXEL as f64).round();
        let mut power = 0.0;
        for row in field.rows() {
            let (mut re, mut im) = (0.0, 0.0);
            for (column, value) in row.iter().enumerate() {
                let phase = std::f64::consts::TAU * index * column as f64 / width as f64;
                re += f64::from(value - 1.0) * phase.cos();
                im += f64::from(value - 1.0) * phase.sin();
            }
            power += (re * re + im * im) / (height * width) as f64;
        }
        power
    }

    #[test]
    fn mean_and_contrast_are_as_stated() {
        for spectrum in [Spectrum::Sand, Spectrum::Fractal] {
            let field = spectrum.synthesise(320, 240, 0.2, 4);
            assert!((field.mean().unwrap() - 1.0).abs() < 1e-4);
            // Clipping at four standard deviations takes 1e-4 of it.
            assert!((field.std(0.0) / 0.2 - 1.0).abs() < 1e-3, "{}", field.std(0.0));
            assert!(field.iter().all(|value| (0.2..=1.8).contains(value)));
        }
        assert!(Spectrum::Sand.synthesise(64, 64, 0.6, 4).iter().any(|&value| value == CLIP.0));
        assert!(Spectrum::Sand.synthesise(64, 64, 0.0, 4).iter().all(|&value| value == 1.0));
    }

    #[test]
    fn sand_is_fine_grain_and_fractal_is_coarse() {
        let sand = Spectrum::Sand.synthesise(320, 240, 0.2, 4);
        // Blurred white noise falls by exp(-(2 pi f 0.5)^2) in power: by 10.2 from 0.2 to 0.52 cycles per
        // px, a sum over one direction; the 1/f part matters below. A band of 608 rows has a standard error
        // of 4 %.
        let ratio = row_power(&sand, 0.2) / row_power(&sand, 0.52);
        let expected = (std::f64::consts::PI.powi(2) * (0.52f64.powi(2) - 0.2f64.powi(2))).exp();
        assert!((ratio / expected - 1.0).abs() < 0.35, "{ratio} {expected}");
        let fractal = Spectrum::Fractal.synthesise(320, 240, 0.2, 4);
        // Amplitude 1/f in the plane is power f^-1 along a line: 8 for a ratio of 8, with the plane's limit
        // taking some.
        let ratio = row_power(&fractal, 0.05) / row_power(&fractal, 0.4);
        assert!((8.0..14.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn equal_seeds_give_equal_textures() {
        let field = |seed| Spectrum::Sand.synthesise(40, 30, 0.2, seed);
        assert_eq!(field(1), field(1));
        assert_ne!(field(1), field(2));
    }
}
