//! Image noise and the resulting standard deviation of depth.

use std::{fmt, str::FromStr};

use farnear_depth::{corrections::Correction, pipeline::DepthMap, prepare::noise::PairNoise};
use farnear_files::image_file::Samples;
use ndarray::{Array2, Zip};
use serde::Serialize;

use crate::{error::Result, figures::rounded_for, quantile};

/// Step for a correction's slope in parts of the correction's range: far above rounding, far below the curvature.
const SLOPE_STEP: f64 = 0.02;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraNoise {
    Estimated,
    Camera {
        /// Electrons from black to the largest code (float images: to the value 1).
        full_well_e: f64,
        read_noise_e: f64,
        /// Camera bits, if the file has more.
        bits: Option<u8>,
        /// Camera code (float images: value) of a pixel without light.
        black: f64,
    },
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{reason}")]
pub struct NoiseError {
    pub text: String,
    pub reason: String,
}

impl FromStr for CameraNoise {
    type Err = NoiseError;

    fn from_str(text: &str) -> Result<Self, NoiseError> {
        parse(text).map_err(|reason| NoiseError { text: text.into(), reason })
    }
}

fn parse(text: &str) -> Result<CameraNoise, String> {
    const EXPECTED: &str =
        "expected estimated or camera:full_well_e=20000,read_noise_e=12 (and bits=12, black=100)";
    if text == "estimated" {
        return Ok(CameraNoise::Estimated);
    }
    let values = text.strip_prefix("camera:").ok_or(EXPECTED)?;
    let [mut full_well, mut read_noise, mut bits, mut black] = [None; 4];
    for part in values.split(',') {
        let (name, value) = part.split_once('=').ok_or(EXPECTED)?;
        let place = match name {
            "full_well_e" => &mut full_well,
            "read_noise_e" => &mut read_noise,
            "bits" => &mut bits,
            "black" => &mut black,
            _ => return Err(format!("unknown {name}: {EXPECTED}")),
        };
        let number: f64 =
            value.parse().map_err(|_| format!("{name} = {value} is not a number: {EXPECTED}"))?;
        if place.replace(number).is_some() {
            return Err(format!("{name} is given twice"));
        }
    }
    let [Some(full_well_e), Some(read_noise_e)] = [full_well, read_noise] else {
        return Err(format!("full_well_e and read_noise_e are both needed: {EXPECTED}"));
    };
    if !(full_well_e.is_finite() && full_well_e > 0.0 && read_noise_e.is_finite() && read_noise_e >= 0.0) {
        return Err("full_well_e must be above 0 and read_noise_e 0 or more electrons".into());
    }
    let bits = match bits {
        Some(bits) if bits.fract() == 0.0 && (4.0..=16.0).contains(&bits) => Some(bits as u8),
        Some(bits) => return Err(format!("bits = {bits}: a camera has 4 to 16")),
        None => None,
    };
    let black = black.unwrap_or(0.0);
    let brightest = bits.map_or(65_535.0, |bits| 2f64.powi(i32::from(bits)) - 1.0);
    if !(0.0..brightest).contains(&black) {
        return Err(format!("black = {black}: expected a code from 0 to below {brightest}"));
    }
    Ok(CameraNoise::Camera { full_well_e, read_noise_e, bits, black })
}

impl fmt::Display for CameraNoise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Estimated => write!(f, "estimated"),
            Self::Camera { full_well_e, read_noise_e, bits, black } => {
                write!(f, "camera:full_well_e={full_well_e},read_noise_e={read_noise_e}")?;
                bits.map_or(Ok(()), |bits| write!(f, ",bits={bits}"))?;
                if *black > 0.0 { write!(f, ",black={black}") } else { Ok(()) }
            }
        }
    }
}

impl CameraNoise {
    /// Noise of images with values of 1 at full scale; `None` to estimate it.
    pub fn of_camera(self, samples: Samples) -> Option<PairNoise> {
        let Self::Camera { full_well_e, read_noise_e, bits, black } = self else { return None };
        let bits = match samples {
            Samples::Integer(of_file) => Some(bits.map_or(of_file, |bits| bits.min(of_file))),
            Samples::Float => bits,
        };
        let code = bits.map_or(1.0, |bits| (2f64.powi(i32::from(bits)) - 1.0).recip());
        let rounding = bits.map_or(0.0, |_| code * code / 12.0);
        let black = (black * code).clamp(0.0, 0.99);
        let per_unit = (1.0 - black) / full_well_e;
        // Shot noise is zero at the black level.
        let constant = ((1.0 - black) * read_noise_e / full_well_e).powi(2) + rounding - per_unit * black;
        // At half of full scale.
        let mean_variance = (constant + 0.5 * per_unit).max(0.0);
        Some(PairNoise { constant, per_unit, mean_variance, ..PairNoise::default() })
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Uncertainty {
    pub noise: String,
    /// Over pixels with a value.
    pub median_sd_mm: f64,
    pub p95_sd_mm: f64,
}

/// `deviation` of the map `raw` (before `correction`), mm, as corrected; NaN without a depth.
pub fn corrected(
    noise: CameraNoise,
    mut deviation: Array2<f32>,
    raw: &DepthMap,
    correction: Option<&Correction>,
) -> Result<(Array2<f32>, Uncertainty)> {
    Zip::from(&mut deviation).and(&raw.depth_mm).for_each(|deviation, depth_mm| {
        if depth_mm.is_nan() {
            *deviation = f32::NAN;
        }
    });
    if let Some(correction) = correction {
        let (far_mm, near_mm) = correction.range_mm();
        let half_mm = (0.5 * SLOPE_STEP * (far_mm - near_mm)) as f32;
        let moved = |step_mm: f32| correction.apply(raw.depth_mm.mapv(|depth_mm| depth_mm + step_mm).view());
        let [nearer, middle, farther] = [moved(-half_mm)?, moved(0.0)?, moved(half_mm)?];
        Zip::from(&mut deviation).and(&nearer).and(&middle).and(&farther).for_each(
            |deviation, nearer, middle, farther| {
                // One end of the step may be beyond the correction's scale.
                let ends = [nearer, farther].map(|end| if end.is_nan() { *middle } else { *end });
                let halves = f32::from(!nearer.is_nan()) + f32::from(!farther.is_nan());
                let slope = (ends[1] - ends[0]).abs() / (halves * half_mm);
                *deviation = if middle.is_nan() { f32::NAN } else { *deviation * slope };
            },
        );
    }
    let [median_sd_mm, p95_sd_mm] = [0.5, 0.95].map(|part| {
        let deviation = quantile::of_map(deviation.view(), part).unwrap_or(f64::NAN);
        rounded_for(deviation, deviation, 4)
    });
    Ok((deviation, Uncertainty { noise: noise.to_string(), median_sd_mm, p95_sd_mm }))
}

#[cfg(test)]
mod tests {
    use farnear_depth::corrections::{CdcSettings, Method, Pattern, fit};

    use super::*;

    #[test]
    fn noise_is_named_like_everything_else() {
        let camera = "camera:full_well_e=20000,read_noise_e=12,bits=12";
        let with_black = "camera:full_well_e=20000,read_noise_e=12,bits=16,black=100";
        for text in ["estimated", camera, with_black, "camera:full_well_e=5e4,read_noise_e=0"] {
            let noise: CameraNoise = text.parse().unwrap();
            assert_eq!(noise.to_string().parse(), Ok(noise));
        }
        for (wrong, phrase) in [
            ("far.png", "expected estimated"),
            ("camera:full_well_e=20000", "both needed"),
            ("camera:full_well_e=0,read_noise_e=1", "above 0"),
            ("camera:full_well_e=1,read_noise_e=NaN", "0 or more"),
            ("camera:full_well_e=1,read_noise_e=1,gain=2", "unknown gain"),
            ("camera:full_well_e=1,full_well_e=1,read_noise_e=1", "twice"),
            ("camera:full_well_e=1,read_noise_e=1,bits=17", "4 to 16"),
            ("camera:full_well_e=1,read_noise_e=1,bits=8,black=255", "below 255"),
            ("camera:full_well_e=1,read_noise_e=1,black=-1", "from 0"),
        ] {
            let error = wrong.parse::<CameraNoise>().unwrap_err();
            assert!(error.reason.contains(phrase), "{wrong}: {error}");
        }
    }

    /// Read noise, rounding and shot noise, in parts of full scale.
    #[test]
    fn noise_follows_the_scale_of_the_images() {
        let noise = CameraNoise::Camera { full_well_e: 20_000.0, read_noise_e: 12.0, bits: None, black: 0.0 };
        let PairNoise { constant, per_unit, .. } = noise.of_camera(Samples::Integer(8)).unwrap();
        assert!((constant - (12.0_f64 / 20_000.0).powi(2) - 1.0 / (12.0 * 255.0 * 255.0)).abs() < 1e-15);
        assert!((per_unit * 20_000.0 - 1.0).abs() < 1e-12);
    }

    /// With black at code 100 of 1023: only read noise at code 100, full well at code 1023.
    #[test]
    fn shot_noise_counts_from_the_black_level() {
        let noise: CameraNoise =
            "camera:full_well_e=20000,read_noise_e=12,bits=10,black=100".parse().unwrap();
        let PairNoise { constant, per_unit, .. } = noise.of_camera(Samples::Integer(10)).unwrap();
        let codes_per_electron: f64 = 923.0 / 20_000.0;
        let at = |code: f64| (constant + per_unit * code / 1023.0) * 1023.0 * 1023.0 - 1.0 / 12.0;
        let read = (12.0 * codes_per_electron).powi(2);
        assert!((at(100.0) - read).abs() < 1e-9, "{}", at(100.0));
        assert!((at(1023.0) - read - 923.0 * codes_per_electron).abs() < 1e-9);
    }

    /// As of a microscope, whose range is below a micrometre.
    #[test]
    fn a_small_deviation_is_not_rounded_to_zero() {
        let raw = DepthMap {
            depth_mm: Array2::from_elem((4, 4), 6.5),
            confidence: Array2::ones((4, 4)),
            filled: None,
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        };
        let deviation = Array2::from_elem((4, 4), 2.345e-5);
        let (_, found) = corrected(CameraNoise::Estimated, deviation, &raw, None).unwrap();
        assert_eq!((found.median_sd_mm, found.p95_sd_mm), (2.345e-5, 2.345e-5));
    }

    /// Patterns over half a millimetre, as of a macro lens, whose depths are 1.1 times as far apart as the targets.
    #[test]
    fn a_small_range_has_its_slope_up_to_the_end_of_the_scale() {
        let patterns: Vec<(Array2<f32>, f64)> = (0..5)
            .map(|index| 0.125 * f64::from(index) - 0.25)
            .map(|away| (Array2::from_elem((12, 12), (100.0 + 1.1 * away) as f32), 100.0 + away))
            .collect();
        let patterns: Vec<Pattern<'_>> = patterns
            .iter()
            .map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm: *true_mm })
            .collect();
        let correction = fit(Method::ClsfFull, &patterns, &CdcSettings::default()).unwrap();
        let mut depth_mm = Array2::from_elem((12, 12), 100.0_f32);
        // The scale ends 0.325 mm from the middle.
        for (place, value) in [((0, 0), 100.323), ((0, 1), 99.677), ((0, 2), 100.4), ((0, 3), f32::NAN)] {
            depth_mm[place] = value;
        }
        let raw = DepthMap {
            confidence: Array2::ones((12, 12)),
            depth_mm,
            filled: None,
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        };
        let deviation = Array2::from_elem((12, 12), 0.01);
        let (deviation, found) =
            corrected(CameraNoise::Estimated, deviation, &raw, Some(&correction)).unwrap();
        for place in [(5, 5), (0, 0), (0, 1)] {
            assert!((deviation[place] * 1.1 - 0.01).abs() < 3e-4, "{place:?}: {}", deviation[place]);
        }
        assert!(deviation[(0, 2)].is_nan() && deviation[(0, 3)].is_nan());
        assert!((found.median_sd_mm - 0.0091).abs() < 1e-4, "{found:?}");
    }
}
