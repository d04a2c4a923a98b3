//! Textured planes rendered in the Fourier domain, independent of `hil-sim/scene`. A square texture with two samples
//! per pixel (white noise blurred by a Gaussian of SD 0.5 px plus 30 % of 1/f noise, mean 1, contrast 0.2) is
//! multiplied by the OTF and the pixel's own, then sampled at the pixels.
#![allow(dead_code, clippy::unwrap_used)] // Each test file uses its part; helpers of tests may fail like tests.

use std::f64::consts::PI;

use farnear_depth::optics::{Optics, OpticsFile};
use farnear_depth::psf::Psf;
use farnear_scene::standard;
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustfft::{FftDirection, FftPlannerScalar, num_complex::Complex64};

/// Rig of Li 2014: 50 mm, aperture 12.8 mm, 7.4 um pixels, 933 mm far focus, largest blur 2.703 px.
pub fn rig(psf: &str) -> Optics {
    let mut file: OpticsFile = toml::from_str(standard::OPTICS).unwrap();
    file.psf = psf.parse().unwrap();
    file.check().unwrap()
}

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let [a, b]: [f64; 2] = [1.0 - rng.random::<f64>(), rng.random()];
    (-2.0 * a.ln()).sqrt() * (2.0 * PI * b).cos()
}

fn transform(data: &mut [Complex64], n: usize, direction: FftDirection) {
    let fft = FftPlannerScalar::new().plan_fft(n, direction);
    for _ in 0..2 {
        fft.process(data);
        for y in 0..n {
            for x in 0..y {
                data.swap(y * n + x, x * n + y);
            }
        }
    }
}

pub struct Texture {
    side_px: usize,
    spectrum: Vec<Complex64>,
}

impl Texture {
    /// A texture of `side_px` x `side_px` pixels, periodic at its borders.
    pub fn sand(side_px: usize, seed: u64) -> Self {
        let n = 2 * side_px;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut field = |amplitude: &dyn Fn(f64) -> f64| {
            let mut data: Vec<Complex64> =
                (0..n * n).map(|_| Complex64::new(normal(&mut rng), 0.0)).collect();
            transform(&mut data, n, FftDirection::Forward);
            for (i, value) in data.iter_mut().enumerate() {
                let f = frequency(i / n, n).hypot(frequency(i % n, n));
                *value *= if i == 0 { 0.0 } else { amplitude(f) };
            }
            let power: f64 = data.iter().map(|v| v.norm_sqr()).sum::<f64>();
            let scale = (n * n) as f64 / power.sqrt();
            (data, scale)
        };
        let (grain, grain_scale) = field(&|f| (-0.5 * (PI * f).powi(2)).exp());
        let (fractal, fractal_scale) = field(&|f| 1.0 / f.max(1.0 / 64.0));
        let mut spectrum: Vec<Complex64> = grain
            .iter()
            .zip(&fractal)
            .map(|(g, f)| (g * (0.954 * grain_scale) + f * (0.3 * fractal_scale)) * 0.2)
            .collect();
        spectrum[0] = Complex64::new((n * n) as f64, 0.0);
        Self { side_px, spectrum }
    }

    /// The texture with a disc of uniform brightness in its middle.
    pub fn with_even_disc(mut self, radius_px: f64) -> Self {
        let n = 2 * self.side_px;
        transform(&mut self.spectrum, n, FftDirection::Inverse);
        for (i, value) in self.spectrum.iter_mut().enumerate() {
            let [y, x] = [i / n, i % n].map(|c| 0.5 * (c as f64 - n as f64 / 2.0));
            *value /= (n * n) as f64;
            if y.hypot(x) < radius_px {
                *value = Complex64::new(1.0, 0.0);
            }
        }
        transform(&mut self.spectrum, n, FftDirection::Forward);
        self
    }

    pub fn pair(&self, psf: Psf, max_blur_px: f64, alpha: f64) -> [Array2<f32>; 2] {
        let otf = psf.otf_up_to(2.0 * std::f64::consts::SQRT_2 * PI * max_blur_px);
        [1.0 + alpha, 1.0 - alpha].map(|factor| {
            let n = 2 * self.side_px;
            let mut data = self.spectrum.clone();
            let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
            for (i, value) in data.iter_mut().enumerate() {
                let [fy, fx] = [frequency(i / n, n), frequency(i % n, n)];
                *value *= otf.at(0.5 * factor * max_blur_px, 2.0 * PI * fy.hypot(fx)) * sinc(fx) * sinc(fy);
            }
            transform(&mut data, n, FftDirection::Inverse);
            Array2::from_shape_fn((self.side_px, self.side_px), |(y, x)| {
                (data[2 * y * n + 2 * x].re / (n * n) as f64) as f32
            })
        })
    }
}

/// Cycles per pixel of bin `i` of `n` at two samples per pixel.
fn frequency(i: usize, n: usize) -> f64 {
    let signed = if i > n / 2 { i as f64 - n as f64 } else { i as f64 };
    2.0 * signed / n as f64
}

/// The image (mean 1) quantised to 8 bits.
pub fn eight_bit(image: &Array2<f32>, seed: u64) -> Array2<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [full_well, level, read] = [20_000.0, 0.45, 12.0];
    image.mapv(|v| {
        let electrons = f64::from(v) * level * full_well;
        let noisy = electrons + electrons.max(0.0).sqrt() * normal(&mut rng) + read * normal(&mut rng);
        (noisy / full_well * 255.0).round().clamp(0.0, 255.0) as f32
    })
}
