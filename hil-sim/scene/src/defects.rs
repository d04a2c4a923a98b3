//! Shading of the light, then hot pixels (the same ones in every exposure of a seed); none by default.

use ndarray::Array2;
use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::camera::CameraError;

/// Generator stream of hot pixels; the texture uses 0, exposures count from 1.
const HOT_STREAM: u64 = u64::MAX;

/// Shading and hot pixels of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Defects {
    /// Share of the light lost in the corners, 0 to 1; grows with the squared distance from the centre.
    pub vignetting: f64,
    /// Change of illumination from left to right and top to bottom, relative to the centre.
    pub uneven_light: [f64; 2],
    /// Share of hot pixels, 0 to 1.
    pub hot_pixel_share: f64,
    /// Largest number of electrons added by a hot pixel.
    pub hot_pixel_e: f64,
}

impl Defects {
    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let [across, down] = self.uneven_light;
        let ranges = [
            ("vignetting", self.vignetting, 0.0..=1.0, "0 to 1"),
            ("uneven_light across", across, -1.9..=1.9, "-1.9 to 1.9"),
            ("uneven_light down", down, -1.9..=1.9, "-1.9 to 1.9"),
            ("hot_pixel_share", self.hot_pixel_share, 0.0..=1.0, "0 to 1"),
            ("hot_pixel_e", self.hot_pixel_e, 0.0..=1e9, "0 to 1e9 electrons"),
        ];
        for (name, value, range, expected) in ranges {
            if !range.contains(&value) {
                return Err(CameraError::Unusable { name, value, expected });
            }
        }
        Ok(())
    }

    pub(crate) fn shade(&self, light: &mut Array2<f32>) {
        let [across, down] = self.uneven_light;
        if self.vignetting == 0.0 && across == 0.0 && down == 0.0 {
            return;
        }
        let (height, width) = light.dim();
        let (width, height) = (width as f64, height as f64);
        let corner2 = width * width + height * height;
        for ((row, column), light) in light.indexed_iter_mut() {
            // Doubled distance from the centre, so that the corner is at `corner2`.
            let (x, y) = (column as f64 + 0.5 - 0.5 * width, row as f64 + 0.5 - 0.5 * height);
            let vignetted = 1.0 - self.vignetting * 4.0 * (x * x + y * y) / corner2;
            let lit = 1.0 + across * x / width + down * y / height;
            *light *= (vignetted * lit).max(0.0) as f32;
        }
    }

    /// Electrons per pixel; `None` without hot pixels.
    pub(crate) fn hot_e(&self, (height, width): (usize, usize), seed: u64) -> Option<Array2<f64>> {
        if self.hot_pixel_share <= 0.0 || self.hot_pixel_e <= 0.0 {
            return None;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(HOT_STREAM);
        let mut unit = || f64::from(random.next_u32()) / f64::from(u32::MAX);
        Some(Array2::from_shape_simple_fn((height, width), || {
            let (chance, strength) = (unit(), unit());
            if chance < self.hot_pixel_share { strength * self.hot_pixel_e } else { 0.0 }
        }))
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::{Camera, Noise};

    use super::*;

    fn flat(camera: &Camera, exposure: u32) -> Array2<u16> {
        let light = Array2::from_elem((camera.height_px, camera.width_px), 1.0f32);
        camera.expose(light.view(), 7, exposure)
    }

    #[test]
    fn corners_are_darker_by_the_stated_share_and_the_middle_is_not() {
        let plain = Camera::new(401, 301, Noise::None);
        let camera = Camera { defects: Defects { vignetting: 0.2, ..Defects::default() }, ..plain.clone() };
        let (plain, shaded) = (flat(&plain, 0), flat(&camera, 0));
        let ratio = |at: [usize; 2]| f64::from(shaded[at]) / f64::from(plain[at]);
        // Codes of 16 bit: rounding is below 2e-5. The corner's pixel lies half a pixel inside: 0.2 % of the loss.
        assert!((ratio([150, 200]) - 1.0).abs() < 2e-5);
        assert!((ratio([0, 0]) - 0.8).abs() < 2e-3 && (ratio([300, 400]) - 0.8).abs() < 2e-3);
    }

    #[test]
    fn uneven_light_changes_linearly() {
        let defects = Defects { uneven_light: [0.3, 0.0], ..Defects::default() };
        let camera = Camera { defects, ..Camera::new(300, 10, Noise::None) };
        let codes = flat(&camera, 0);
        let (left, middle, right) =
            (f64::from(codes[[5, 0]]), f64::from(codes[[5, 150]]), f64::from(codes[[5, 299]]));
        // From border to border 0.3 of the middle's; pixel centres are 299 of 300 px apart.
        assert!(((right - left) / middle - 0.3).abs() < 2e-3, "{left} {middle} {right}");
    }

    #[test]
    fn hot_pixels_are_the_same_ones_in_every_exposure_and_as_many_as_stated() {
        let defects = Defects { hot_pixel_share: 1e-3, hot_pixel_e: 9_000.0, ..Defects::default() };
        let camera = Camera { defects, read_noise_e: 0.0, ..Camera::new(500, 400, Noise::None) };
        let (first, second) = (flat(&camera, 0), flat(&camera, 1));
        assert_eq!(first, second, "without noise nothing else differs");
        let usual = flat(&Camera { defects: Defects::default(), ..camera.clone() }, 0)[[0, 0]];
        let hot = first.iter().filter(|&&code| code > usual).count();
        // 200 of 200,000 expected; five standard deviations of that count.
        assert!((130..=270).contains(&hot), "{hot}");
    }

    #[test]
    fn rejects_invalid_defects_by_name() {
        let text = |defects: Defects| defects.check().unwrap_err().to_string();
        assert!(text(Defects { vignetting: 1.5, ..Defects::default() }).contains("vignetting = 1.5"));
        assert!(
            text(Defects { hot_pixel_share: f64::NAN, ..Defects::default() })
                .contains("hot_pixel_share = NaN")
        );
    }
}
