//! `optics.toml` as written, and the check that turns it into [`Optics`]. The renderer (`hil-sim/scene`) parses the
//! same files independently of this crate; a test compares numbers and messages.

use serde::{Deserialize, Serialize};

use super::{DistortionSection, Optics, OpticsError, Stage, image_mm};
use crate::psf::Psf;

/// Largest relative difference between a given blur radius and the one that follows from `near_mm`.
const AGREEMENT: f64 = 0.02;

/// `[lens]` of an optics file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensSection {
    /// Focal length F.
    pub focal_length_mm: f64,
    /// Diameter of the aperture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aperture_mm: Option<f64>,
    /// f-number, the focal length over the diameter of the aperture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
    /// Whether the lens is telecentric on the image side, so that moving the sensor changes neither the magnification nor the
    /// blur by the image distance. Taken as telecentric where it is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub telecentric: Option<bool>,
}

/// `[sensor]` of an optics file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSection {
    /// Pixel pitch.
    pub pixel_um: f64,
}

/// `[focus]` of an optics file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FocusSection {
    /// Object distance that is sharp in the far-focused image.
    pub far_mm: f64,
    /// Blur radius in the far-focused image of an object at the near focus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_blur_px: Option<f64>,
    /// Object distance that is sharp in the near-focused image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_mm: Option<f64>,
}

/// `[light]` of an optics file, in percent: the light outputs that commands of the rig switch on without `--light`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSection {
    /// First output.
    #[serde(default)]
    pub first: f64,
    /// Second output.
    #[serde(default)]
    pub second: f64,
}

/// An optics file as written, to be checked by [`OpticsFile::check`]. One of `max_blur_px` and `near_mm` suffices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpticsFile {
    /// Lens and aperture.
    pub lens: LensSection,
    /// Sensor.
    pub sensor: SensorSection,
    /// Focus distances.
    pub focus: FocusSection,
    /// Point-spread function; a pill-box where the file names none.
    #[serde(default)]
    pub psf: Psf,
    /// Distortion of the lens; none where the file names none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<DistortionSection>,
    /// What a z-stack of a flat target taught.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<Stage>,
    /// Light during exposures; off where the file names none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<LightSection>,
}

impl OpticsFile {
    /// Checks the values and derives the others. An [`OpticsError`] names the offending value.
    pub fn check(&self) -> Result<Optics, OpticsError> {
        let focal_length_mm = positive("lens", "focal_length_mm", self.lens.focal_length_mm, " of mm")?;
        let f_number = self.f_number(focal_length_mm)?;
        let pixel_um = positive("sensor", "pixel_um", self.sensor.pixel_um, " of um")?;
        let far_mm = positive("focus", "far_mm", self.focus.far_mm, " of mm")?;
        beyond_focal_length("far_mm", far_mm, focal_length_mm)?;
        let psf = self.psf.checked()?;
        let telecentric = self.lens.telecentric;
        let distortion = self.distortion.as_ref().map(DistortionSection::check).transpose()?;
        if let Some(problem) = self.stage.as_ref().and_then(Stage::problem) {
            return Err(OpticsError::Stage(problem));
        }
        let of_blur = |max_blur_px| Optics {
            focal_length_mm,
            f_number,
            pixel_um,
            far_mm,
            max_blur_px,
            psf,
            telecentric,
            distortion,
            stage: self.stage,
        };
        let of_near = |near_mm: f64| -> Result<Optics, OpticsError> {
            beyond_focal_length("near_mm", near_mm, focal_length_mm)?;
            if near_mm >= far_mm {
                return Err(OpticsError::NearBeyondFar { far_mm, near_mm });
            }
            let [sensor_far_mm, sensor_near_mm] = [far_mm, near_mm].map(|u| image_mm(focal_length_mm, u));
            let half_travel_mm = 0.5 * (sensor_near_mm - sensor_far_mm);
            let longer = match telecentric {
                Some(false) => (sensor_far_mm + half_travel_mm) / focal_length_mm,
                Some(true) | None => 1.0,
            };
            Ok(of_blur(half_travel_mm / (f_number * longer) / (pixel_um * 1e-3)))
        };
        let blur =
            self.focus.max_blur_px.map(|r| positive("focus", "max_blur_px", r, " of px")).transpose()?;
        let near = self.focus.near_mm.map(|u| positive("focus", "near_mm", u, " of mm")).transpose()?;
        match (blur, near) {
            (None, None) => Err(OpticsError::NoRange),
            (Some(max_blur_px), None) => Ok(of_blur(max_blur_px)),
            (None, Some(near_mm)) => of_near(near_mm),
            (Some(max_blur_px), Some(near_mm)) => {
                let blur_would_be_px = of_near(near_mm)?.max_blur_px;
                let optics = of_blur(max_blur_px);
                let difference = (max_blur_px / blur_would_be_px - 1.0).abs();
                if difference > AGREEMENT {
                    return Err(OpticsError::RangeDisagrees {
                        max_blur_px,
                        near_mm,
                        near_would_be_mm: optics.working_range().near_mm,
                        blur_would_be_px,
                        percent: 100.0 * difference,
                    });
                }
                Ok(optics)
            }
        }
    }

    fn f_number(&self, focal_length_mm: f64) -> Result<f64, OpticsError> {
        let aperture =
            self.lens.aperture_mm.map(|a| positive("lens", "aperture_mm", a, " of mm")).transpose()?;
        let f_number = self.lens.f_number.map(|f| positive("lens", "f_number", f, "")).transpose()?;
        match (aperture, f_number) {
            (None, None) => Err(OpticsError::NoAperture),
            (Some(aperture_mm), None) => Ok(focal_length_mm / aperture_mm),
            (None, Some(f_number)) => Ok(f_number),
            (Some(aperture_mm), Some(f_number)) => {
                let would_be = focal_length_mm / aperture_mm;
                if (f_number / would_be - 1.0).abs() > AGREEMENT {
                    return Err(OpticsError::ApertureDisagrees {
                        focal_length_mm,
                        aperture_mm,
                        f_number,
                        would_be,
                    });
                }
                Ok(f_number)
            }
        }
    }
}

fn positive(
    section: &'static str,
    name: &'static str,
    value: f64,
    unit: &'static str,
) -> Result<f64, OpticsError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(OpticsError::NotPositive { section, name, value, unit })
    }
}

fn beyond_focal_length(name: &'static str, value_mm: f64, focal_length_mm: f64) -> Result<(), OpticsError> {
    if value_mm > focal_length_mm {
        Ok(())
    } else {
        Err(OpticsError::InsideFocalLength { name, value_mm, focal_length_mm })
    }
}

impl TryFrom<OpticsFile> for Optics {
    type Error = OpticsError;

    fn try_from(file: OpticsFile) -> Result<Self, OpticsError> {
        file.check()
    }
}

impl From<Optics> for OpticsFile {
    fn from(optics: Optics) -> Self {
        Self {
            lens: LensSection {
                focal_length_mm: optics.focal_length_mm,
                aperture_mm: None,
                f_number: Some(optics.f_number),
                telecentric: optics.telecentric,
            },
            sensor: SensorSection { pixel_um: optics.pixel_um },
            focus: FocusSection {
                far_mm: optics.far_mm,
                max_blur_px: Some(optics.max_blur_px),
                near_mm: None,
            },
            psf: optics.psf,
            distortion: optics.distortion.map(DistortionSection::from),
            stage: optics.stage,
            light: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::tests::{RIG, rig};

    #[test]
    fn near_distance_and_blur_follow_from_each_other() {
        let mut file = rig();
        let near_mm = file.check().unwrap().working_range().near_mm;
        file.focus = FocusSection { far_mm: 933.0, max_blur_px: None, near_mm: Some(near_mm) };
        assert!((file.check().unwrap().max_blur_px() - 2.703).abs() < 1e-9);
    }

    #[test]
    fn an_aperture_at_the_lens_has_a_cone_as_long_as_the_image_distance() {
        // A macro lens at about 1:2. By similar triangles a point at w makes a disc of radius |s - w| D / 2w on a sensor at s.
        let mut file = rig();
        file.lens = LensSection {
            focal_length_mm: 50.0,
            aperture_mm: Some(10.0),
            f_number: None,
            telecentric: Some(false),
        };
        file.focus = FocusSection { far_mm: 150.0, max_blur_px: None, near_mm: Some(149.0) };
        let [far, near] = [150.0, 149.0].map(|u: f64| 50.0 * u / (u - 50.0));
        let discs_px = [far, near].map(|w| (near - far) * 10.0 / (2.0 * w) / 0.0074);
        let optics = file.check().unwrap();
        assert!((discs_px[1]..discs_px[0]).contains(&optics.max_blur_px()), "{}", optics.max_blur_px());
        file.focus =
            FocusSection { far_mm: 150.0, max_blur_px: Some(optics.max_blur_px()), near_mm: Some(149.0) };
        assert!((file.check().unwrap().working_range().near_mm - 149.0).abs() < 1e-9);
        file.lens.telecentric = Some(true);
        file.focus.max_blur_px = None;
        assert!((file.check().unwrap().max_blur_px() / optics.max_blur_px() - 1.5).abs() < 0.01);
    }

    #[test]
    fn contradictions_name_the_value_that_would_agree() {
        let mut file = rig();
        file.focus.near_mm = Some(880.0);
        let message = file.check().unwrap_err().to_string();
        assert!(message.contains("near_mm = 886.81") && message.contains("max_blur_px = 3.1"), "{message}");
        file.focus.near_mm = Some(886.5);
        assert!(file.check().is_ok());
        file.lens.f_number = Some(5.0);
        assert!(file.check().unwrap_err().to_string().contains("f_number = 3.90625"));
    }

    #[test]
    fn senseless_optics_are_refused() {
        let spoil = |change: fn(&mut OpticsFile)| {
            let mut file = rig();
            change(&mut file);
            file.check().unwrap_err()
        };
        assert!(matches!(
            spoil(|f| f.lens.f_number = Some(0.0)),
            OpticsError::NotPositive { name: "f_number", .. }
        ));
        assert!(matches!(spoil(|f| f.sensor.pixel_um = f64::NAN), OpticsError::NotPositive { .. }));
        assert!(matches!(spoil(|f| f.focus.near_mm = Some(940.0)), OpticsError::NearBeyondFar { .. }));
        assert!(matches!(
            spoil(|f| f.focus.far_mm = 40.0),
            OpticsError::InsideFocalLength { name: "far_mm", .. }
        ));
        assert!(matches!(spoil(|f| f.focus.max_blur_px = None), OpticsError::NoRange));
        assert!(matches!(spoil(|f| f.lens.aperture_mm = None), OpticsError::NoAperture));
    }

    #[test]
    fn checked_optics_survive_a_round_trip_through_toml() {
        const DISTORTION: &str = "
            [distortion]
            camera_matrix = [[1210.5, 0, 318.25], [0, 1208.75, 243.5], [0, 0, 1]]
            coefficients = [-0.31, 0.12, 0.0011, -0.0007, 0.05]";
        for file in [rig(), toml::from_str(&(RIG.to_owned() + DISTORTION)).unwrap()] {
            let optics = file.check().unwrap();
            let text = toml::to_string(&optics).unwrap();
            assert_eq!(toml::from_str::<Optics>(&text).unwrap(), optics);
            assert_eq!(optics.distortion().is_some(), file.distortion.is_some());
        }
    }
}
