//! From irradiance to codes: the camera's size, its electrons and its quantisation.
//!
//! A pixel of mean scene radiance collects `exposure_level` of the full well on average. Each pixel draws a
//! Poisson number of electrons (shot noise), gets normal read noise, is limited to 0..full well and rounded to the
//! camera's codes, the largest code being the full well (Janesick, Photon Transfer, 2007, ch. 3). Costs about 0.1 us a pixel.

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson};
use thiserror::Error;

/// What the camera adds to the light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// No noise; codes of 16 bit, so that what rounding takes is far below any noise.
    None,
    /// Shot and read noise, codes 0..=255.
    EightBit,
    /// Shot and read noise, codes 0..=4095.
    TwelveBit,
}

impl Noise {
    /// Largest code; it stands for the full well.
    #[must_use]
    pub fn max_code(self) -> u16 {
        match self {
            Self::None => u16::MAX,
            Self::EightBit => 255,
            Self::TwelveBit => 4095,
        }
    }

    /// Bits of a code.
    #[must_use]
    pub fn bits(self) -> u8 {
        match self {
            Self::None => 16,
            Self::EightBit => 8,
            Self::TwelveBit => 12,
        }
    }
}

/// Why a camera was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CameraError {
    /// A noise name that does not exist.
    #[error("unknown noise {0:?}, expected none, 8bit or 12bit")]
    UnknownNoise(String),
    /// An image without pixels, or too large to render.
    #[error("camera of {width_px} x {height_px} pixels, expected 1 to {max_px} along each side")]
    Size {
        /// Width, px.
        width_px: usize,
        /// Height, px.
        height_px: usize,
        /// Largest side, px.
        max_px: usize,
    },
    /// A number that makes no camera.
    #[error("camera: {name} = {value}, expected {expected}")]
    Senseless {
        /// Which number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it has to be.
        expected: &'static str,
    },
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
    /// Image width, px.
    pub width_px: usize,
    /// Image height, px.
    pub height_px: usize,
    /// Noise and bits.
    pub noise: Noise,
    /// Electrons that a pixel holds; the largest code.
    pub full_well_e: f64,
    /// Mean signal as a fraction of the full well.
    pub exposure_level: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_e: f64,
}

impl Default for Camera {
    /// 640 x 480, 8 bit.
    fn default() -> Self {
        Self::new(640, 480, Noise::EightBit)
    }
}

impl Camera {
    /// Largest side of an image, px.
    pub const MAX_SIDE_PX: usize = 16_384;

    /// A camera of this size with a full well of 20,000 electrons, exposed to 45 % of it, and a read noise
    /// of 12 electrons.
    #[must_use]
    pub fn new(width_px: usize, height_px: usize, noise: Noise) -> Self {
        Self { width_px, height_px, noise, full_well_e: 20_000.0, exposure_level: 0.45, read_noise_e: 12.0 }
    }

    /// # Errors
    /// [`CameraError`] for a size or a number that no camera has.
    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let sides = 1..=Self::MAX_SIDE_PX;
        if !sides.contains(&self.width_px) || !sides.contains(&self.height_px) {
            return Err(CameraError::Size {
                width_px: self.width_px,
                height_px: self.height_px,
                max_px: Self::MAX_SIDE_PX,
            });
        }
        let senseless = |name, value, expected| Err(CameraError::Senseless { name, value, expected });
        if !(self.full_well_e >= 1.0 && self.full_well_e <= 1e9) {
            return senseless("full_well_e", self.full_well_e, "1 to 1e9 electrons");
        }
        if !(self.exposure_level > 0.0 && self.exposure_level <= 100.0) {
            return senseless("exposure_level", self.exposure_level, "a fraction of the full well above 0");
        }
        if !(self.read_noise_e >= 0.0 && self.read_noise_e <= 1e9) {
            return senseless("read_noise_e", self.read_noise_e, "0 to 1e9 electrons");
        }
        Ok(())
    }

    /// Codes of one exposure of `radiance` (blurred scene, mean 1). The noise is a function of `seed` and
    /// `exposure_number` alone. The camera must have passed its check.
    pub(crate) fn expose(
        &self,
        radiance: ArrayView2<'_, f32>,
        seed: u64,
        exposure_number: u32,
    ) -> Array2<u16> {
        let max_code = f64::from(self.noise.max_code());
        let code = |electrons: f64| {
            (electrons.clamp(0.0, self.full_well_e) / self.full_well_e * max_code).round() as u16
        };
        let mean_e = self.exposure_level * self.full_well_e;
        if self.noise == Noise::None {
            return radiance.map(|&radiance| code(f64::from(radiance) * mean_e));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1 + u64::from(exposure_number)); // stream 0 is the texture's
        let read_noise = Normal::new(0.0, self.read_noise_e).ok();
        // Row by row in a fixed order: the noise of a pixel depends on its place, not on threads.
        radiance.map(|&radiance| {
            let expected_e = f64::from(radiance) * mean_e;
            // No light has no Poisson distribution, and no electrons.
            let collected_e = Poisson::new(expected_e).map_or(0.0, |shot| shot.sample(&mut random));
            code(collected_e + read_noise.map_or(0.0, |read_noise| read_noise.sample(&mut random)))
        })
    }
}
