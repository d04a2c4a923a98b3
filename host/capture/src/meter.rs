//! Automatic exposure time from test images.

use std::time::Duration;

use farnear_protocol::{message::Shot, units::Micros};

use crate::{
    camera::{Camera, Image},
    client::Client,
    expose::{CaptureError, expose},
};

/// Brightness of the brightest pixels, as a share of white: noise and the other focus need the rest.
const TARGET: f64 = 0.8;
/// Accepted without another exposure.
const GOOD: std::ops::Range<f64> = 0.72..0.88;
/// Share of pixels that may be brighter: reflections and hot pixels.
const BRIGHTER: f64 = 0.005;
/// From here on a pixel may be saturated.
const SATURATED: f64 = 0.98;
/// Largest change between two exposures.
const STEP_MAX: f64 = 8.0;
const EXPOSURES_MAX: usize = 8;

/// Finds the brightest unsaturated exposure, by up to 8 of `shot`; returns the nearest time within the board's limits.
pub fn exposure(
    client: &Client,
    camera: &mut dyn Camera,
    shot: Shot,
    image_wait: Duration,
) -> Result<Micros, CaptureError> {
    let limits = &client.hello().limits;
    let mut shot = shot;
    for _ in 0..EXPOSURES_MAX {
        let mut brightness = 0.0;
        expose(client, camera, &[shot], image_wait, |_, image| -> Result<(), CaptureError> {
            brightness = brightest(&image);
            Ok(())
        })?;
        if GOOD.contains(&brightness) {
            break;
        }
        let factor =
            if brightness > SATURATED { 0.25 } else { (TARGET / brightness.max(1e-3)).min(STEP_MAX) };
        let next = Micros((f64::from(shot.exposure.0) * factor).round() as u32);
        let next = next.clamp(limits.exposure_min, limits.exposure_max);
        if next == shot.exposure {
            break;
        }
        shot.exposure = next;
    }
    Ok(shot.exposure)
}

/// Brightness that a share [`BRIGHTER`] of the pixels exceeds, as a share of white.
fn brightest(image: &Image) -> f64 {
    let white = (1_usize << image.bits.min(16)) - 1;
    let mut counts = vec![0_usize; white + 1];
    image.pixels.iter().for_each(|code| counts[usize::from(*code).min(white)] += 1);
    let mut left = (BRIGHTER * image.pixels.len() as f64) as usize;
    for (code, count) in counts.iter().enumerate().rev() {
        if *count > left {
            return code as f64 / white as f64;
        }
        left -= count;
    }
    0.0
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    #[test]
    fn few_bright_pixels_do_not_count() {
        let mut pixels = Array2::from_elem((20, 100), 51);
        pixels.iter_mut().take(10).for_each(|code| *code = 255);
        let image = Image::new(pixels, 8);
        assert_eq!(brightest(&image), 0.2);
        let pixels = image.pixels.mapv(|code| if code == 51 { 60 } else { code });
        let mut image = Image::new(pixels, 8);
        image.pixels[[19, 99]] = 255;
        assert_eq!(brightest(&image), 1.0, "11 of 2000 pixels");
    }
}
