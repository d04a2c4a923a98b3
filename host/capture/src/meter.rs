//! Automatic exposure time from test images.

use std::time::Duration;

use farnear_protocol::{message::Shot, units::Micros};

use crate::{
    camera::{Camera, Control, Image, Range, Setting},
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

/// Finds the brightest unsaturated exposure within the limits of board and camera, by up to 8 of `shot`. Returns the best of
/// their times, and the brightness of its brightest pixels as a share of white.
pub fn exposure(
    client: &Client,
    camera: &mut dyn Camera,
    shot: Shot,
    image_wait: Duration,
) -> Result<(Micros, f64), CaptureError> {
    let limits = &client.hello().limits;
    let own = if camera.sets_exposure(shot.mode) { camera.controls()? } else { Vec::new() };
    let (min, max) = within((limits.exposure_min, limits.exposure_max), &own);
    let mut shot = Shot { exposure: shot.exposure.clamp(min, max), ..shot };
    let (mut best, mut least_off) = ((shot.exposure, 0.0), f64::INFINITY);
    for _ in 0..EXPOSURES_MAX {
        let mut brightness = 0.0;
        expose(client, camera, &[shot], image_wait, |_, image| -> Result<(), CaptureError> {
            brightness = brightest(&image);
            Ok(())
        })?;
        // Among saturated images the shortest exposure is the best.
        let off = if brightness > SATURATED {
            1.0 + f64::from(shot.exposure.0)
        } else {
            (brightness - TARGET).abs()
        };
        if off < least_off {
            (best, least_off) = ((shot.exposure, brightness), off);
        }
        if GOOD.contains(&brightness) {
            break;
        }
        let factor =
            if brightness > SATURATED { 0.25 } else { (TARGET / brightness.max(1e-3)).min(STEP_MAX) };
        let next = Micros((f64::from(shot.exposure.0) * factor).round() as u32);
        let next = next.clamp(min, max);
        if next == shot.exposure {
            break;
        }
        shot.exposure = next;
    }
    Ok(best)
}

/// Limits of the board within the camera's range, if it states one.
fn within((min, max): (Micros, Micros), controls: &[Control]) -> (Micros, Micros) {
    let own = controls.iter().find(|control| control.name == Setting::ExposureUs(0.0).name());
    match own.map(|control| &control.range) {
        Some(Range::Number { min: shortest, max: longest, .. }) => {
            let min = min.max(Micros(shortest.ceil() as u32));
            (min, max.min(Micros(longest.floor() as u32)).max(min))
        }
        _ => (min, max),
    }
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
    fn the_exposure_stays_within_the_cameras_range() {
        let board = (Micros(10), Micros(1_000_000));
        let control = |name: &str, min, max| Control {
            name: name.into(),
            value: "1000".into(),
            range: Range::Number { min, max, unit: "us" },
        };
        assert_eq!(within(board, &[]), board);
        assert_eq!(within(board, &[control("gain", 1.0, 16.0)]), board);
        let own = [control("gain", 1.0, 16.0), control("exposure_us", 20.5, 30_000.5)];
        assert_eq!(within(board, &own), (Micros(21), Micros(30_000)));
        assert_eq!(within(board, &[control("exposure_us", 1.0, 1e9)]), board);
        let disjoint = within(board, &[control("exposure_us", 2e6, 3e6)]);
        assert_eq!(disjoint, (Micros(2_000_000), Micros(2_000_000)), "the board refuses it by name");
    }

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
