//! Calibration frames of a camera. `dark` is the mean of exposures with the lens covered. `flat` is each pixel's
//! response to even light, (light - dark) relative to its mean in a large window; the slow falloff of lamp and lens
//! remains for balancing. A pixel is bad if its dark value or response is far from all others.

use ndarray::{Array2, ArrayView2, Zip};

use super::{band::box_mean, defects};
use crate::reason::Reason;

/// Side of the window for a pixel's relative response.
const SURROUNDINGS_PX: usize = 31;
/// Robust standard deviations from which a pixel is bad.
const BAD: f32 = 8.0;
/// Part of the flats' mean by which a pixel's dark value may differ from the others: subtracting it is exact enough.
const DARK_OF_FLAT: f64 = 0.01;
/// Differences of values that are rounding errors, in full scales.
const SAME: f32 = 1e-6;
/// Part of saturated pixels from which an exposure is rejected; hot pixels are fewer.
const SATURATED: f64 = 0.01;
/// Side of the window whose mean has little noise left, and the least structure in it that dust and falloff cannot
/// cause: standard deviation relative to the flats' mean, whose scale does not depend on the bits in use.
const SMOOTHED_PX: usize = 7;
const STRUCTURE: f64 = 0.04;
/// Part of bad pixels from which the light was not even; no camera has as many.
const MANY_BAD: f64 = 0.02;
/// Part of an image below half of the dark frame, by more than a part of the image's mean, from which they do not belong
/// together. Noise and hot pixels are less.
const DARKER: f64 = 0.01;
const CLEARLY_DARKER: f32 = 0.05;
/// Least and largest response of a good pixel.
const RESPONSE: [f32; 2] = [0.5, 1.5];

/// An error of a camera's frames.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CameraError {
    #[error(
        "the camera's frames are {width}x{height}, the images {image_width}x{image_height}: calibrate the camera in the mode of the images"
    )]
    Size { width: usize, height: usize, image_width: usize, image_height: usize },
    #[error("no {kind} exposures: give at least one")]
    None { kind: &'static str },
    #[error(
        "{kind} exposure {number}: {percent:.1} % of its pixels are saturated; give evenly lit exposures at about half of full scale"
    )]
    Saturated { kind: &'static str, number: usize, percent: f64 },
    #[error(
        "{kind} exposure {number} has structure: its brightness varies by {percent:.1} % over {SURROUNDINGS_PX} px, {expected}; is it a picture of the \
         scene? Give {advice}"
    )]
    Structured {
        kind: &'static str,
        number: usize,
        /// SD of the smoothed brightness around its surroundings, percent of the flats' mean.
        percent: f64,
        expected: &'static str,
        advice: &'static str,
    },
    #[error(
        "the flat exposures have a mean of {flat:.4}, the dark ones of {dark:.4}: give evenly lit exposures at about half of \
         full scale"
    )]
    NoLight { flat: f64, dark: f64 },
    #[error(
        "{percent:.1} % of the pixels would be bad: give exposures of an evenly lit surface, out of focus, and dark ones of the same \
         exposure time"
    )]
    Uneven { percent: f64 },
    #[error(
        "{percent:.0} % of the image are darker than half of the camera's dark frame: give dark exposures with the images' settings, \
         exposure time and bits"
    )]
    Darker { percent: f64 },
}

/// Rejects exposures of which too many pixels reach `white`.
pub fn check_saturation(
    kind: &'static str,
    number: usize,
    image: &Array2<f32>,
    white: f32,
) -> Result<(), CameraError> {
    let saturated = image.iter().filter(|value| **value >= white).count() as f64 / image.len().max(1) as f64;
    if saturated > SATURATED {
        return Err(CameraError::Saturated { kind, number, percent: 100.0 * saturated });
    }
    Ok(())
}

/// Rejects exposures that are saturated or show a scene.
fn check_exposure(
    kind: &'static str,
    number: usize,
    image: &Array2<f32>,
    of_flats: f64,
) -> Result<(), CameraError> {
    check_saturation(kind, number, image, 1.0)?;
    let smooth = box_mean(image.view(), SMOOTHED_PX);
    let around = box_mean(smooth.view(), SURROUNDINGS_PX);
    let differences = || smooth.iter().zip(&around).map(|(value, around)| f64::from(value - around));
    // Robust against single bad pixels and grains of dust.
    let mut sizes: Vec<f32> = differences().map(|difference| difference.abs() as f32).collect();
    let at = (0.9 * sizes.len().saturating_sub(1) as f64) as usize;
    let usual = if sizes.is_empty() { 0.0 } else { *sizes.select_nth_unstable_by(at, f32::total_cmp).1 };
    // 90 % of a normal distribution lie within 1.645 standard deviations.
    let deviation = f64::from(usual) / 1.645;
    let relative = deviation / of_flats.max(1e-6);
    let (expected, advice) = if kind == "flat" {
        ("an even one by less than 4 %", "exposures of an evenly lit surface, out of focus")
    } else {
        ("a dark one by less than 4 % of the flat exposures' mean", "exposures with the lens covered")
    };
    if relative > STRUCTURE {
        return Err(CameraError::Structured { kind, number, percent: 100.0 * relative, expected, advice });
    }
    Ok(())
}

/// A camera's frames, (height, width).
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFrames {
    dark: Array2<f32>,
    response: Array2<f32>,
    bad: Array2<bool>,
}

impl CameraFrames {
    /// Stored frames. Returns [`CameraError::Size`] if they differ in size.
    pub fn new(dark: Array2<f32>, response: Array2<f32>, bad: Array2<bool>) -> Result<Self, CameraError> {
        let frames = Self { dark, response, bad };
        frames.check_size(frames.response.dim())?;
        let (height, width) = frames.bad.dim();
        if frames.response.dim() != frames.bad.dim() {
            let (image_height, image_width) = frames.response.dim();
            return Err(CameraError::Size { width, height, image_width, image_height });
        }
        Ok(frames)
    }

    /// Learns the frames from dark and evenly lit exposures of one size.
    pub fn learn(dark: &[Array2<f32>], flat: &[Array2<f32>]) -> Result<Self, CameraError> {
        let average =
            |image: &Array2<f32>| image.iter().map(|v| f64::from(*v)).sum::<f64>() / image.len() as f64;
        let exposures = [("flat", flat), ("dark", dark)];
        let flat = mean(flat, "flat")?;
        let of_flat = average(&flat);
        for (kind, exposures) in exposures {
            for (index, exposure) in exposures.iter().enumerate() {
                check_exposure(kind, index + 1, exposure, of_flat)?;
            }
        }
        let dark_exposures = dark;
        let dark = if dark.is_empty() { Array2::zeros(flat.dim()) } else { mean(dark, "dark")? };
        if dark.dim() != flat.dim() {
            let ((height, width), (image_height, image_width)) = (dark.dim(), flat.dim());
            return Err(CameraError::Size { width, height, image_width, image_height });
        }
        let light = &flat - &dark;
        let of_dark = average(&dark);
        if of_flat - of_dark <= 0.02 * of_flat.abs() || of_flat <= 0.0 {
            return Err(CameraError::NoLight { flat: of_flat, dark: of_dark });
        }
        let around = box_mean(light.view(), SURROUNDINGS_PX);
        let response = &light / &around.mapv(|v| v.max(1e-6));
        let far_off = |image: &Array2<f32>, middle: f32, least: f32| {
            let spread = 1.4826 * median(image.iter().map(|v| (v - middle).abs()));
            let limit = (BAD * spread.max(SAME)).max(least);
            image.mapv(|v| (v - middle).abs() > limit)
        };
        let [of_dark, of_response] = [&dark, &response].map(|image| median(image.iter().copied()));
        // Where most dark pixels have one code, as black ones have, their spread is that of rounding.
        let rounding = step_from(of_dark, dark_exposures) / 12_f32.sqrt();
        let least = (BAD * rounding).max((DARK_OF_FLAT * of_flat) as f32);
        let [of_dark, of_response] = [far_off(&dark, of_dark, least), far_off(&response, of_response, 0.0)];
        let [least, largest] = RESPONSE;
        let bad = Zip::from(&of_dark)
            .and(&of_response)
            .and(&response)
            .map_collect(|a, b, v| *a || *b || !(least..=largest).contains(v));
        let frames = Self { dark, response, bad };
        let part = frames.bad_count() as f64 / frames.bad.len().max(1) as f64;
        if part > MANY_BAD {
            return Err(CameraError::Uneven { percent: 100.0 * part });
        }
        Ok(frames)
    }

    /// For images whose values were divided by `white`.
    pub fn relative_to(mut self, white: f32) -> Self {
        self.dark.mapv_inplace(|value| value / white);
        self
    }

    /// The dark frame.
    pub fn dark(&self) -> ArrayView2<'_, f32> {
        self.dark.view()
    }

    /// Response of each pixel, about 1.
    pub fn response(&self) -> ArrayView2<'_, f32> {
        self.response.view()
    }

    /// Bad pixels, if there are any.
    pub fn bad(&self) -> Option<ArrayView2<'_, bool>> {
        self.bad.iter().any(|bad| *bad).then(|| self.bad.view())
    }

    /// Mask of the bad pixels.
    pub fn bad_pixels(&self) -> ArrayView2<'_, bool> {
        self.bad.view()
    }

    /// Number of bad pixels.
    pub fn bad_count(&self) -> usize {
        self.bad.iter().filter(|bad| **bad).count()
    }

    /// Corrects an image with values from 0 to 1 for dark signal, response and single bad pixels; patches of bad pixels
    /// are unchanged. Returns [`CameraError::Size`] for an image of another size.
    pub fn correct(&self, image: ArrayView2<f32>) -> Result<Array2<f32>, CameraError> {
        self.check(image)?;
        let seen = self.apply(image);
        let Some(bad) = self.bad() else { return Ok(seen) };
        let marks = bad.mapv(|bad| if bad { Reason::BadPixel.code() } else { 0 });
        let mut mended = seen.clone();
        defects::mend(&mut mended, &marks);
        Zip::from(&mut mended).and(&seen).for_each(|mended, seen| {
            if mended.is_nan() {
                *mended = *seen;
            }
        });
        Ok(mended)
    }

    /// [`correct`](Self::correct) of an image that is clipped at `white`: clipped pixels remain there, and others get at most
    /// `white`.
    pub fn correct_below(&self, image: ArrayView2<f32>, white: f32) -> Result<Array2<f32>, CameraError> {
        let mut seen = self.correct(image)?;
        Zip::from(&mut seen).and(&image).and(&self.bad).for_each(|seen, value, bad| {
            let is_known = *value < white || *bad && value.is_finite();
            *seen = if is_known { seen.min(white) } else { *value };
        });
        Ok(seen)
    }

    /// Whether an image was taken as the frames were.
    pub(super) fn check(&self, image: ArrayView2<f32>) -> Result<(), CameraError> {
        self.check_size(image.dim())?;
        let finite = || image.iter().filter(|value| value.is_finite());
        let mean = finite().map(|value| f64::from(*value)).sum::<f64>() / finite().count().max(1) as f64;
        let margin = CLEARLY_DARKER * mean as f32;
        let darker = image.iter().zip(&self.dark).filter(|(value, dark)| **value + margin < 0.5 * **dark);
        let part = darker.count() as f64 / image.len().max(1) as f64;
        if part > DARKER { Err(CameraError::Darker { percent: 100.0 * part }) } else { Ok(()) }
    }

    fn check_size(&self, (image_height, image_width): (usize, usize)) -> Result<(), CameraError> {
        let (height, width) = self.dark.dim();
        if (height, width) == (image_height, image_width) {
            return Ok(());
        }
        Err(CameraError::Size { width, height, image_width, image_height })
    }

    /// Corrects dark signal and response.
    pub(super) fn apply(&self, image: ArrayView2<f32>) -> Array2<f32> {
        Zip::from(&image).and(&self.dark).and(&self.response).map_collect(|v, dark, response| {
            let [least, largest] = RESPONSE;
            (v - dark) / response.clamp(least, largest)
        })
    }
}

fn mean(images: &[Array2<f32>], kind: &'static str) -> Result<Array2<f32>, CameraError> {
    let first = images.first().ok_or(CameraError::None { kind })?;
    let mut sum = Array2::<f32>::zeros(first.dim());
    for image in images {
        if image.dim() != first.dim() {
            let ((height, width), (image_height, image_width)) = (first.dim(), image.dim());
            return Err(CameraError::Size { width, height, image_width, image_height });
        }
        sum += image;
    }
    Ok(sum / images.len() as f32)
}

/// Least difference of the exposures' values from `middle`, a code in most exposures; 0 if all are equal.
fn step_from(middle: f32, exposures: &[Array2<f32>]) -> f32 {
    let differences = exposures.iter().flatten().map(|value| (value - middle).abs());
    let least = differences.filter(|difference| *difference > SAME).fold(f32::INFINITY, f32::min);
    if least.is_finite() { least } else { 0.0 }
}

fn median(values: impl Iterator<Item = f32>) -> f32 {
    crate::median::median(values.collect(), f32::total_cmp).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response(y: usize, x: usize) -> f32 {
        1.0 + 0.03 * (((y * 131 + x * 71) % 17) as f32 / 8.0 - 1.0)
    }

    #[test]
    fn a_learned_camera_sees_evenly() {
        let dark = Array2::from_shape_fn((60, 80), |(y, x)| 0.01 + 0.002 * ((y + x) % 3) as f32);
        let mut flat = Array2::from_shape_fn((60, 80), |(y, x)| 0.5 * response(y, x)) + &dark;
        flat[(20, 30)] = 0.02;
        let frames = CameraFrames::learn(std::slice::from_ref(&dark), std::slice::from_ref(&flat)).unwrap();
        assert_eq!(frames.bad_count(), 1);
        assert!(frames.bad().unwrap()[(20, 30)]);
        let seen = frames.apply(flat.view());
        for ((y, x), value) in seen.indexed_iter().filter(|(at, _)| *at != (20, 30)) {
            assert!((value - 0.5).abs() < 0.01, "({x}, {y}): {value}");
        }
    }

    /// Eight bits, clipped at black: most dark pixels are 0, and some are one code in some of the exposures.
    #[test]
    fn one_code_of_dark_signal_is_not_bad() {
        let dark = |exposure: usize| {
            Array2::from_shape_fn((60, 80), |(y, x)| match (y * 7919 + x * 104_729 + exposure * 31) % 10 {
                _ if (y, x) == (10, 10) => 0.3,
                0..2 => 1.0 / 255.0,
                _ => 0.0,
            })
        };
        let darks = [dark(0), dark(1), dark(2)];
        let flat = Array2::from_shape_fn((60, 80), |(y, x)| 0.5 * response(y, x)) + &darks[0];
        for darks in [&darks[..1], &darks[..]] {
            let frames = CameraFrames::learn(darks, std::slice::from_ref(&flat)).unwrap();
            assert_eq!(frames.bad_count(), 1, "{} exposures", darks.len());
            assert!(frames.bad().unwrap()[(10, 10)]);
        }
    }

    #[test]
    fn a_corrected_image_has_no_pattern_and_no_bad_pixel() {
        let dark = Array2::from_elem((60, 80), 0.02);
        let mut flat = Array2::from_shape_fn((60, 80), |(y, x)| 0.5 * response(y, x)) + &dark;
        flat[(20, 30)] = 0.02;
        let frames = CameraFrames::learn(std::slice::from_ref(&dark), std::slice::from_ref(&flat)).unwrap();
        let seen = frames.correct(flat.view()).unwrap();
        for ((y, x), value) in seen.indexed_iter() {
            assert!((value - 0.5).abs() < 0.01, "({x}, {y}): {value}");
        }
        assert!(matches!(frames.correct(Array2::zeros((3, 4)).view()), Err(CameraError::Size { .. })));
    }

    #[test]
    fn frames_that_do_not_fit_are_refused() {
        let image = |height, value| Array2::from_elem((height, 40), value);
        assert!(matches!(CameraFrames::learn(&[], &[]), Err(CameraError::None { kind: "flat" })));
        assert!(matches!(
            CameraFrames::learn(&[image(30, 0.1)], &[image(31, 0.5)]),
            Err(CameraError::Size { .. })
        ));
        assert!(matches!(
            CameraFrames::learn(&[image(30, 0.5)], &[image(30, 0.5)]),
            Err(CameraError::NoLight { .. })
        ));
        let frames = CameraFrames::learn(&[], &[image(30, 0.5)]).unwrap();
        assert!(frames.check(image(31, 0.5).view()).unwrap_err().to_string().contains("40x30"));
    }

    #[test]
    fn dark_frames_of_another_scale_are_refused() {
        let scene = Array2::from_shape_fn((30, 40), |(y, x)| 0.02 + 0.3 * ((x + y) % 40) as f32 / 40.0);
        let frames = |dark: f32| {
            CameraFrames::learn(&[Array2::from_elem((30, 40), dark)], &[Array2::from_elem((30, 40), 0.6)])
                .unwrap()
        };
        assert!(frames(0.02).check(scene.view()).is_ok());
        // Four bits more.
        let error = frames(16.0 * 0.02).check(scene.view()).unwrap_err();
        assert!(matches!(error, CameraError::Darker { percent } if percent > 10.0), "{error}");
        // A black background without a black level.
        let black = scene.mapv(|v| if v < 0.2 { 0.0 } else { v });
        assert!(frames(1e-3).check(black.view()).is_ok());
    }

    #[test]
    fn rejects_saturated_and_structured_exposures_with_the_figure() {
        let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) % 97) as f32 / 97.0 - 0.5;
        // Falloff of a fifth to the border, noise of 5 %, as in real flats.
        let flat = Array2::from_shape_fn((90, 120), |(y, x)| {
            let [u, v] = [x as f32 / 60.0 - 1.0, y as f32 / 45.0 - 1.0];
            0.5 * (1.0 - 0.1 * (u * u + v * v)) * (1.0 + 0.1 * noise(x, y))
        });
        assert!(CameraFrames::learn(&[], std::slice::from_ref(&flat)).is_ok());
        let white = Array2::from_elem((90, 120), 1.0);
        let error = CameraFrames::learn(&[], &[flat.clone(), white]).unwrap_err().to_string();
        assert!(error.starts_with("flat exposure 2: 100.0 % of its pixels are saturated"), "{error}");
        let scene = Array2::from_shape_fn((90, 120), |(y, x)| {
            0.4 + 0.3 * ((x as f32 / 5.0).sin() * (y as f32 / 7.0).cos())
        });
        let error = CameraFrames::learn(&[], std::slice::from_ref(&scene)).unwrap_err().to_string();
        assert!(error.contains("flat exposure 1 has structure") && error.contains('%'), "{error}");
        // Also where the codes use few of the bits.
        for scale in [1.0, 0.06] {
            let [scene, flat] = [&scene, &flat].map(|image| image.mapv(|v| scale * v));
            let error = CameraFrames::learn(&[scene.mapv(|v| 0.3 * v)], &[flat]).unwrap_err().to_string();
            assert!(
                error.contains("dark exposure 1 has structure") && error.contains("lens covered"),
                "{error}"
            );
        }
        let slope = Array2::from_shape_fn((120, 160), |(_, x)| 0.1 + 0.005 * x as f32);
        let error = CameraFrames::learn(&[], &[slope]).unwrap_err().to_string();
        assert!(error.contains("would be bad") && error.contains("evenly lit"), "{error}");
    }
}
