//! Possible but unlikely optics: most likely a number in another unit.

use std::fmt;

use super::Optics;

/// A value far outside the usual range of cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt {
    what: &'static str,
    value: f64,
    /// With a leading blank; empty for a ratio.
    unit: &'static str,
    usual: [f64; 2],
}

const LARGEST_BLUR: &str = "the largest blur";

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, value, unit, usual: [low, high] } = self;
        write!(
            f,
            "{what} is {value:.4}{unit}, usual is {low} to {high}: is a number of the optics in another unit?"
        )
    }
}

impl Optics {
    /// Values that are probably wrong. Of a lens of `calibrate stack`, all but the largest blur are assumed ones.
    pub fn doubts(&self) -> Vec<Doubt> {
        let learned = self.stage.is_some();
        let range = self.working_range();
        let span = (range.far_mm - range.near_mm) / range.far_mm * 100.0;
        [
            ("focal_length_mm", self.focal_length_mm, " mm", [1.0, 2000.0]),
            ("the f-number", self.f_number, "", [0.7, 64.0]),
            ("pixel_um", self.pixel_um, " um", [0.5, 50.0]),
            ("far_mm in focal lengths", self.far_mm / self.focal_length_mm, "", [1.5, 2000.0]),
            (LARGEST_BLUR, self.max_blur_px, " px", [0.5, 8.0]),
            ("the sensor's travel", range.sensor_travel_mm, " mm", [1e-3, 20.0]),
            ("the working range in percent of far_mm", span, " %", [0.05, 75.0]),
        ]
        .into_iter()
        .filter(|(what, ..)| !learned || *what == LARGEST_BLUR)
        .filter(|(_, value, _, [low, high])| !(low..=high).contains(&value))
        .map(|(what, value, unit, usual)| Doubt { what, value, unit, usual })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::optics::{FocusSection, LensSection, OpticsFile, SensorSection, Stage};

    #[test]
    fn other_units_are_noticed() {
        let file = |focal: f64, pixel: f64, far: f64, blur: f64| {
            OpticsFile {
                lens: LensSection {
                    focal_length_mm: focal,
                    aperture_mm: None,
                    f_number: Some(3.9),
                    telecentric: None,
                },
                sensor: SensorSection { pixel_um: pixel },
                focus: FocusSection { far_mm: far, max_blur_px: Some(blur), near_mm: None },
                psf: Default::default(),
                distortion: None,
                stage: None,
                light: None,
            }
            .check()
            .unwrap()
        };
        assert!(file(50.0, 7.4, 933.0, 2.703).doubts().is_empty());
        for wrong in [
            file(0.05, 7.4, 933.0, 2.703),
            file(50.0, 0.0074, 933.0, 2.703),
            file(50.0, 7.4, 933_000.0, 2.703),
        ] {
            let doubts = wrong.doubts();
            assert!(!doubts.is_empty());
            assert!(doubts[0].to_string().contains("usual is"), "{}", doubts[0]);
            // Of a learned lens they are assumed.
            for scale_known in [false, true] {
                let stage = Stage { scale_known, ..Stage::identity(1, 1) };
                assert!(wrong.with_stage(stage).doubts().is_empty(), "{scale_known}");
            }
        }
        let mut closed = file(50.0, 7.4, 933.0, 2.703);
        closed.f_number = 90.0;
        assert!(closed.doubts()[0].to_string().starts_with("the f-number is 90.0000, usual is 0.7 to 64"));
    }
}
