//! Working range from lens, sensor and focus distances, or from a micrometer's readings. A manual rig has readings: m1
//! with the far target in focus, and m2 = m1 + 2 Fe Rmax for the near-focused image (Li 2014, eqs. 4.3 and 4.4). Rmax
//! follows from both readings.

use farnear_depth::optics::{OpticsFile, WorkingRange};
use serde::{Deserialize, Serialize};

use crate::{
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
};

/// Travel per turn of the thesis' micrometer: readings are split into half-millimetres and the rest.
const MAJOR_MM: f64 = 0.5;
const SAMPLES: usize = 33;

#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Readings {
    /// m1: the far target is in focus.
    pub far_mm: Option<f64>,
    /// m2, of the near-focused image. With m1 it gives the largest blur.
    pub near_mm: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Reading {
    pub mm: f64,
    /// Half-millimetres on the sleeve.
    pub major_mm: f64,
    /// The rest, on the thimble.
    pub minor_mm: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Blur {
    pub depth_mm: f64,
    pub far_px: f64,
    pub near_px: f64,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct LensFigures {
    pub range: WorkingRange,
    pub f_number: f64,
    pub aperture_mm: f64,
    pub max_blur_px: f64,
    pub depth_range_mm: f64,
    /// Depth change for a blur change of 0.1 px at mid-range.
    pub depth_per_tenth_px_mm: f64,
    /// Object size seen by a pixel at mid-range.
    pub pixel_footprint_mm: f64,
    /// Sensor distance m1, if it is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reading_far: Option<Reading>,
    /// m2, given or calculated from m1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reading_near: Option<Reading>,
    pub blur: Vec<Blur>,
    pub optics: OpticsFile,
}

pub fn calculate(file: &OpticsFile, readings: Readings) -> Result<LensFigures> {
    let mut file = file.clone();
    for (name, value) in [("m1", readings.far_mm), ("m2", readings.near_mm)] {
        if let Some(value) = value.filter(|value| !value.is_finite() || value.abs() > 1000.0) {
            return Err(WorkflowError::parameter(name, value, "expected a reading in mm"));
        }
    }
    if let (Some(m1), Some(m2)) = (readings.far_mm, readings.near_mm) {
        if m2 <= m1 {
            let expected = format!("expected more than m1 = {m1}: the near focus is further from the lens");
            return Err(WorkflowError::parameter("m2", m2, expected));
        }
        // Any blur completes valid optics, which give the f-number.
        file.focus.near_mm = None;
        file.focus.max_blur_px = Some(1.0);
        let unit = file.check()?.working_range().sensor_travel_mm;
        file.focus.max_blur_px = Some((m2 - m1) / unit);
    }
    let optics = file.check()?;
    let range = optics.working_range();
    let span_mm = range.far_mm - range.near_mm;
    // The radius grows from 0 to Rmax for alpha from -1 to 1: half of Rmax per unit of alpha.
    let per_tenth_px_mm = 0.2 * optics.depth_per_alpha_mm(0.0).abs() / optics.max_blur_px();
    let footprint_mm = optics.pixel_at_object_mm(range.alpha0_mm);
    let blur = (0..SAMPLES).map(|index| {
        let alpha = -1.0 + 2.0 * index as f64 / (SAMPLES - 1) as f64;
        let [far_px, near_px] = optics.blur_px(alpha);
        Blur {
            depth_mm: rounded_for(span_mm, optics.depth_mm(alpha), 3),
            far_px: rounded(far_px, 3),
            near_px: rounded(near_px, 3),
        }
    });
    let near = readings.near_mm.or(readings.far_mm.map(|m1| m1 + range.sensor_travel_mm));
    Ok(LensFigures {
        range,
        f_number: rounded(optics.f_number(), 4),
        aperture_mm: rounded_for(optics.aperture_mm(), optics.aperture_mm(), 4),
        max_blur_px: rounded(optics.max_blur_px(), 4),
        depth_range_mm: rounded_for(span_mm, span_mm, 3),
        depth_per_tenth_px_mm: rounded_for(per_tenth_px_mm, per_tenth_px_mm, 3),
        pixel_footprint_mm: rounded_for(footprint_mm, footprint_mm, 4),
        reading_far: readings.far_mm.map(reading),
        reading_near: near.map(reading),
        blur: blur.collect(),
        optics: OpticsFile::from(optics),
    })
}

fn reading(mm: f64) -> Reading {
    let major = (mm / MAJOR_MM).floor() * MAJOR_MM;
    Reading { mm: rounded(mm, 4), major_mm: rounded(major, 1), minor_mm: rounded(mm - major, 4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Experiment of Li 2014, section 4.5.2: a target at 800 mm, in focus at a reading of 5.17 mm.
    fn thesis() -> OpticsFile {
        toml::from_str(
            "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n[focus]\nfar_mm = 800.0\n\
             max_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n",
        )
        .unwrap()
    }

    #[test]
    fn m2_follows_from_m1() {
        let readings = Readings { far_mm: Some(5.17), near_mm: None };
        let found = calculate(&thesis(), readings).unwrap();
        // 2 F Rmax / d = 2 * 50 * 20.0022 um / 12.8 = 156.27 um.
        let m2 = found.reading_near.unwrap();
        assert!((m2.mm - 5.3263).abs() < 1e-4, "{m2:?}");
        assert_eq!((m2.major_mm, m2.minor_mm), (5.0, 0.3263));
        assert!(found.range.near_mm < 800.0 && found.depth_range_mm > 30.0);
        let ends = (found.blur[0], found.blur[SAMPLES - 1]);
        assert!(ends.0.far_px < 1e-3 && (ends.0.near_px - 2.703).abs() < 1e-3, "{ends:?}");
        assert!((ends.1.far_px - 2.703).abs() < 1e-3 && ends.1.near_px < 1e-3, "{ends:?}");
    }

    #[test]
    fn both_readings_give_the_blur() {
        let readings = Readings { far_mm: Some(5.17), near_mm: Some(5.3263) };
        let mut file = thesis();
        file.focus.max_blur_px = Some(9.0); // overruled
        let found = calculate(&file, readings).unwrap();
        assert!((found.max_blur_px - 2.703).abs() < 1e-3, "{}", found.max_blur_px);
    }

    #[test]
    fn readings_that_make_no_pair_are_refused() {
        for (far_mm, near_mm) in [(5.2, 5.1), (f64::NAN, 5.1), (5.2, 1e9)] {
            let readings = Readings { far_mm: Some(far_mm), near_mm: Some(near_mm) };
            assert!(calculate(&thesis(), readings).unwrap_err().is_usage());
        }
    }
}
