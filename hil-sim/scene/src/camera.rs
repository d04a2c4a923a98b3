//! From irradiance to codes. A pixel of mean radiance collects `exposure_level` of the full well, gets Poisson shot and
//! normal read noise, is limited to 0..full well and rounded to codes (Janesick, Photon Transfer, 2007, ch. 3).

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson};
use thiserror::Error;

use crate::defects::Defects;

/// Noise and bit depth of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// No noise; 16-bit codes, so that rounding is negligible.
    None,
    /// Shot and read noise, codes 0..=255.
    EightBit,
    /// Shot and read noise, codes 0..=4095.
    TwelveBit,
}

impl Noise {
    /// Largest code; equals the full well.
    #[must_use]
    pub fn max_code(self) -> u16 {
        match self {
            Self::None => u16::MAX,
            Self::EightBit => 255,
            Self::TwelveBit => 4095,
        }
    }

    /// Bits of a pixel's code; 16 without noise.
    #[must_use]
    pub fn bits(self) -> u8 {
        match self {
            Self::None => 16,
            Self::EightBit => 8,
            Self::TwelveBit => 12,
        }
    }
}

/// Invalid size, electrons or noise of a camera.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum CameraError {
    #[error("unknown noise {0:?}, expected none, 8bit or 12bit")]
    UnknownNoise(String),
    #[error("camera of {width_px} x {height_px} pixels, expected 1 to {max_px} along each side")]
    Size { width_px: usize, height_px: usize, max_px: usize },
    #[error("camera: {name} = {value}, expected {expected}")]
    Unusable { name: &'static str, value: f64, expected: &'static str },
}

impl FromStr for Noise {
    type Err = CameraError;

    /// `none`, `8bit` or `12bit`.
    fn from_str(text: &str) -> Result<Self, CameraError> {
        match text {
            "none" => Ok(Self::None),
            "8bit" => Ok(Self::EightBit),
            "12bit" => Ok(Self::TwelveBit),
            _ => Err(CameraError::UnknownNoise(text.into())),
        }
    }
}

impl fmt::Display for Noise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::EightBit => "8bit",
            Self::TwelveBit => "12bit",
        })
    }
}

/// Size and electrons of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Pixels per row of the image.
    pub width_px: usize,
    /// Rows of pixels of the image.
    pub height_px: usize,
    /// Noise and bit depth.
    pub noise: Noise,
    /// Electrons at the largest code.
    pub full_well_e: f64,
    /// Mean signal as a fraction of the full well.
    pub exposure_level: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_e: f64,
    /// Shading and hot pixels.
    pub defects: Defects,
}

impl Default for Camera {
    fn default() -> Self {
        Self::new(640, 480, Noise::EightBit)
    }
}

impl Camera {
    /// Largest side of an image, px.
    pub const MAX_SIDE_PX: usize = 16_384;

    /// Full well 20,000 electrons, exposed to 45 %, read noise 12 electrons.
    #[must_use]
    pub fn new(width_px: usize, height_px: usize, noise: Noise) -> Self {
        Self {
            width_px,
            height_px,
            noise,
            full_well_e: 20_000.0,
            exposure_level: 0.45,
            read_noise_e: 12.0,
            defects: Defects::default(),
        }
    }

    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let sides = 1..=Self::MAX_SIDE_PX;
        if !sides.contains(&self.width_px) || !sides.contains(&self.height_px) {
            return Err(CameraError::Size {
                width_px: self.width_px,
                height_px: self.height_px,
                max_px: Self::MAX_SIDE_PX,
            });
        }
        let unusable = |name, value, expected| Err(CameraError::Unusable { name, value, expected });
        if !(self.full_well_e >= 1.0 && self.full_well_e <= 1e9) {
            return unusable("full_well_e", self.full_well_e, "1 to 1e9 electrons");
        }
        if !(self.exposure_level > 0.0 && self.exposure_level <= 100.0) {
            return unusable("exposure_level", self.exposure_level, "a fraction of the full well above 0");
        }
        if !(self.read_noise_e >= 0.0 && self.read_noise_e <= 1e9) {
            return unusable("read_noise_e", self.read_noise_e, "0 to 1e9 electrons");
        }
        self.defects.check()
    }

    /// Codes of one exposure of `radiance` (blurred, mean 1) by a valid camera; noise by `seed` and `exposure_number`.
    #[must_use]
    pub fn expose(&self, radiance: ArrayView2<'_, f32>, seed: u64, exposure_number: u32) -> Array2<u16> {
        let max_code = f64::from(self.noise.max_code());
        let code = |electrons: f64| {
            (electrons.clamp(0.0, self.full_well_e) / self.full_well_e * max_code).round() as u16
        };
        let mean_e = self.exposure_level * self.full_well_e;
        let mut radiance = radiance.to_owned();
        self.defects.shade(&mut radiance);
        let hot_e = self.defects.hot_e(radiance.dim(), seed);
        let mut hot_e = hot_e.iter().flatten().copied().chain(std::iter::repeat(0.0));
        let mut hot_e = || hot_e.next().unwrap_or_default();
        if self.noise == Noise::None {
            return radiance.map(|&radiance| code(f64::from(radiance) * mean_e + hot_e()));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1 + u64::from(exposure_number)); // stream 0 is the texture's
        let read_noise = Normal::new(0.0, self.read_noise_e).ok();
        // Fixed order: noise depends on the pixel's position, not on threads.
        radiance.map(|&radiance| {
            let expected_e = f64::from(radiance) * mean_e;
            // Poisson is undefined without light.
            let collected_e = Poisson::new(expected_e).map_or(0.0, |shot| shot.sample(&mut random));
            code(hot_e() + collected_e + read_noise.map_or(0.0, |read_noise| read_noise.sample(&mut random)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of a flat exposure, electrons.
    fn statistics(camera: &Camera, radiance: f32) -> (f64, f64) {
        let flat = Array2::from_elem((camera.height_px, camera.width_px), radiance);
        let e_per_code = camera.full_well_e / f64::from(camera.noise.max_code());
        let electrons = camera.expose(flat.view(), 9, 0).mapv(|code| f64::from(code) * e_per_code);
        let mean = electrons.mean().unwrap();
        (mean, electrons.mapv(|e| (e - mean).powi(2)).mean().unwrap())
    }

    #[test]
    fn mean_and_variance_are_those_of_shot_read_and_quantisation_noise() {
        for noise in [Noise::EightBit, Noise::TwelveBit] {
            // Below 0.4 the noise is under half an 8-bit code and rounding is biased, as in any camera.
            for radiance in [0.4f32, 1.0, 1.8] {
                let camera = Camera::new(500, 400, noise);
                let (mean, variance) = statistics(&camera, radiance);
                let expected_mean = f64::from(radiance) * 9_000.0;
                let code_e = 20_000.0 / f64::from(noise.max_code());
                let expected_variance = expected_mean + 12.0 * 12.0 + code_e * code_e / 12.0;
                // 200,000 pixels: the mean to 0.22 %, the variance to 0.32 % (1 SD).
                assert!(
                    (mean - expected_mean).abs() < 0.01 * expected_variance.sqrt(),
                    "{noise} {radiance} {mean}"
                );
                assert!((variance / expected_variance - 1.0).abs() < 0.02, "{noise} {radiance} {variance}");
            }
        }
    }

    #[test]
    fn faint_light_follows_poisson_not_a_normal_distribution() {
        let mut camera = Camera::new(400, 400, Noise::TwelveBit);
        (camera.full_well_e, camera.read_noise_e) = (4095.0, 0.0); // one code an electron
        let dark = Array2::from_elem((400, 400), (1.5 / (0.45 * 4095.0)) as f32);
        let codes = camera.expose(dark.view(), 2, 0);
        let mut factorial = 1.0;
        for count in 0..5u16 {
            factorial *= f64::from(count.max(1));
            let share = codes.iter().filter(|&&code| code == count).count() as f64 / codes.len() as f64;
            let poisson = (-1.5f64).exp() * 1.5f64.powi(count.into()) / factorial;
            // Five standard deviations of a share of 160,000.
            assert!(
                (share - poisson).abs() < 5.0 * (poisson / 160_000.0).sqrt(),
                "{count}: {share} {poisson}"
            );
        }
    }

    #[test]
    fn light_beyond_the_full_well_saturates_and_darkness_is_zero() {
        for noise in [Noise::None, Noise::EightBit, Noise::TwelveBit] {
            let mut camera = Camera::new(2, 1, noise);
            camera.read_noise_e = 0.0;
            let codes = camera.expose(ndarray::array![[0.0, 3.0]].view(), 1, 0);
            assert_eq!(codes, ndarray::array![[0, noise.max_code()]], "{noise}");
        }
    }

    #[test]
    fn rejects_invalid_cameras_by_name() {
        let text = |camera: Camera| camera.check().unwrap_err().to_string();
        assert!(text(Camera::new(0, 480, Noise::None)).contains("0 x 480"));
        assert!(text(Camera { full_well_e: f64::NAN, ..Camera::default() }).contains("full_well_e = NaN"));
        assert!(text(Camera { exposure_level: 0.0, ..Camera::default() }).contains("exposure_level = 0"));
        assert!(text(Camera { read_noise_e: -1.0, ..Camera::default() }).contains("read_noise_e = -1"));
        assert!("9bit".parse::<Noise>().unwrap_err().to_string().contains("9bit"));
    }
}
