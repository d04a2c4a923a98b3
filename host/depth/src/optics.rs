//! Telecentric thin-lens geometry of a depth-from-defocus pair whose *sensor* moves.
//!
//! The far-focused image is taken with the sensor at `s1`, the near-focused one at `s2 = s1 + 2e`. An object whose
//! image lies at the distance `w` from the lens has the normalised depth `alpha` with `w = s1 + (1 + alpha) e`: it
//! is -1 at the far focus, +1 at the near focus, and rises as the object comes nearer. The blur radii are
//! `R1 = (1 + alpha) e / (2 Fe)` and `R2 = (1 - alpha) e / (2 Fe)`, so `2e = 2 Fe Rmax` (Li 2014, eqs. 4.1, 4.3 and
//! 5.11; the thin lens is `1/F = 1/u + 1/w`).
//!
//! Units: millimetres unless a name says otherwise; blur radii in pixels. Every function is O(1).

use serde::{Deserialize, Serialize};

use crate::psf::{Psf, PsfError};

/// The largest relative difference between a given blur radius and the one that `near_mm` leads to.
const AGREEMENT: f64 = 0.02;

/// What is wrong with a set of optics.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OpticsError {
    /// A number that must be positive and finite is not.
    #[error("[{section}] {name} = {value}: must be a positive, finite number of {unit}")]
    NotPositive {
        /// Section of the file.
        section: &'static str,
        /// Name of the value.
        name: &'static str,
        /// What was given.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// Neither `aperture_mm` nor `f_number` was given.
    #[error("[lens] needs aperture_mm or f_number")]
    NoAperture,
    /// `aperture_mm` and `f_number` are both given and contradict each other.
    #[error(
        "[lens] aperture_mm = {aperture_mm} and f_number = {f_number} disagree: with focal_length_mm = \
         {focal_length_mm} that aperture is f_number = {would_be:.5}; give one of them"
    )]
    ApertureDisagrees {
        /// Given focal length.
        focal_length_mm: f64,
        /// Given aperture diameter.
        aperture_mm: f64,
        /// Given f-number.
        f_number: f64,
        /// The f-number that the aperture leads to.
        would_be: f64,
    },
    /// Neither `max_blur_px` nor `near_mm` was given.
    #[error("[focus] needs max_blur_px or near_mm")]
    NoRange,
    /// `near_mm` is not nearer than `far_mm`.
    #[error(
        "[focus] near_mm = {near_mm} is not nearer than far_mm = {far_mm}: the near focus must be the smaller distance"
    )]
    NearBeyondFar {
        /// Given far focus.
        far_mm: f64,
        /// Given near focus.
        near_mm: f64,
    },
    /// A focus distance at which a thin lens forms no real image.
    #[error(
        "[focus] {name} = {value_mm} is not beyond the focal length of {focal_length_mm} mm: no real image forms"
    )]
    InsideFocalLength {
        /// Which distance.
        name: &'static str,
        /// Its value.
        value_mm: f64,
        /// The focal length.
        focal_length_mm: f64,
    },
    /// `max_blur_px` and `near_mm` contradict each other.
    #[error(
        "[focus] max_blur_px = {max_blur_px} and near_mm = {near_mm} disagree by {percent:.1} % (2 % allowed): \
         near_mm = {near_would_be_mm:.2} would agree with that blur, max_blur_px = {blur_would_be_px:.4} with that distance"
    )]
    RangeDisagrees {
        /// Given blur radius.
        max_blur_px: f64,
        /// Given near focus.
        near_mm: f64,
        /// Near focus that the blur leads to.
        near_would_be_mm: f64,
        /// Blur that the near focus leads to.
        blur_would_be_px: f64,
        /// Relative difference of the blur radii in percent.
        percent: f64,
    },
    /// The point-spread function's parameters are unusable.
    #[error("[psf] {0}")]
    Psf(#[from] PsfError),
}

/// `[lens]` of an optics file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensSection {
    /// Focal length F.
    pub focal_length_mm: f64,
    /// Diameter 2a of the telecentric aperture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aperture_mm: Option<f64>,
    /// f-number `Fe = F / (2a)`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
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

/// An optics file as written, before [`OpticsFile::check`] makes [`Optics`] of it.
///
/// `max_blur_px` and `near_mm` follow from each other: one suffices.
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
}

impl OpticsFile {
    /// Checks the values and completes what follows from them.
    ///
    /// # Errors
    /// An [`OpticsError`] that names the offending value and, for contradictions, the value that would agree.
    pub fn check(&self) -> Result<Optics, OpticsError> {
        let focal_length_mm = positive("lens", "focal_length_mm", self.lens.focal_length_mm, "mm")?;
        let f_number = self.f_number(focal_length_mm)?;
        let pixel_um = positive("sensor", "pixel_um", self.sensor.pixel_um, "um")?;
        let far_mm = positive("focus", "far_mm", self.focus.far_mm, "mm")?;
        beyond_focal_length("far_mm", far_mm, focal_length_mm)?;
        let psf = self.psf.checked()?;
        let of_blur = |max_blur_px| Optics { focal_length_mm, f_number, pixel_um, far_mm, max_blur_px, psf };
        let of_near = |near_mm: f64| -> Result<Optics, OpticsError> {
            beyond_focal_length("near_mm", near_mm, focal_length_mm)?;
            if near_mm >= far_mm {
                return Err(OpticsError::NearBeyondFar { far_mm, near_mm });
            }
            let travel_mm = image_mm(focal_length_mm, near_mm) - image_mm(focal_length_mm, far_mm);
            Ok(of_blur(travel_mm / (2.0 * f_number) / (pixel_um * 1e-3)))
        };
        let blur = self.focus.max_blur_px.map(|r| positive("focus", "max_blur_px", r, "px")).transpose()?;
        let near = self.focus.near_mm.map(|u| positive("focus", "near_mm", u, "mm")).transpose()?;
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
        let aperture = self.lens.aperture_mm.map(|a| positive("lens", "aperture_mm", a, "mm")).transpose()?;
        let f_number = self.lens.f_number.map(|f| positive("lens", "f_number", f, "1")).transpose()?;
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

/// Image distance of an object at `object_mm`; the thin lens is its own inverse, so this also maps back.
fn image_mm(focal_length_mm: f64, object_mm: f64) -> f64 {
    focal_length_mm + focal_length_mm * focal_length_mm / (object_mm - focal_length_mm)
}

/// Checked optics of a pair: made by [`OpticsFile::check`], therefore always consistent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "OpticsFile", into = "OpticsFile")]
pub struct Optics {
    focal_length_mm: f64,
    f_number: f64,
    pixel_um: f64,
    far_mm: f64,
    max_blur_px: f64,
    psf: Psf,
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
            },
            sensor: SensorSection { pixel_um: optics.pixel_um },
            focus: FocusSection {
                far_mm: optics.far_mm,
                max_blur_px: Some(optics.max_blur_px),
                near_mm: None,
            },
            psf: optics.psf,
        }
    }
}

/// The distances between which a pair measures depth, and where the sensor stands for them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorkingRange {
    /// Object distance of the far focus (alpha = -1).
    pub far_mm: f64,
    /// Object distance of the near focus (alpha = +1).
    pub near_mm: f64,
    /// Lens to sensor for the far-focused image, s1.
    pub sensor_far_mm: f64,
    /// Lens to sensor for the near-focused image, s2.
    pub sensor_near_mm: f64,
    /// Sensor travel between the two images, 2e.
    pub sensor_travel_mm: f64,
    /// Object distance of alpha = 0, which is not the middle of the range in millimetres.
    pub alpha0_mm: f64,
}

impl Optics {
    /// Focal length F in mm.
    pub fn focal_length_mm(&self) -> f64 {
        self.focal_length_mm
    }

    /// f-number Fe.
    pub fn f_number(&self) -> f64 {
        self.f_number
    }

    /// Diameter of the aperture in mm.
    pub fn aperture_mm(&self) -> f64 {
        self.focal_length_mm / self.f_number
    }

    /// Pixel pitch in micrometres.
    pub fn pixel_um(&self) -> f64 {
        self.pixel_um
    }

    /// Largest blur radius Rmax in pixels.
    pub fn max_blur_px(&self) -> f64 {
        self.max_blur_px
    }

    /// Point-spread function of the lens.
    pub fn psf(&self) -> Psf {
        self.psf
    }

    /// The same geometry with another point-spread function.
    pub fn with_psf(self, psf: Psf) -> Self {
        Self { psf, ..self }
    }

    /// Half the sensor travel, e, in mm.
    fn half_travel_mm(&self) -> f64 {
        self.f_number * self.max_blur_px * self.pixel_um * 1e-3
    }

    /// Object and sensor distances of the pair.
    pub fn working_range(&self) -> WorkingRange {
        let sensor_far_mm = image_mm(self.focal_length_mm, self.far_mm);
        let e = self.half_travel_mm();
        WorkingRange {
            far_mm: self.far_mm,
            near_mm: self.depth_mm(1.0),
            sensor_far_mm,
            sensor_near_mm: sensor_far_mm + 2.0 * e,
            sensor_travel_mm: 2.0 * e,
            alpha0_mm: self.depth_mm(0.0),
        }
    }

    /// Object distance in mm of the normalised depth `alpha`.
    pub fn depth_mm(&self, alpha: f64) -> f64 {
        let [offset, slope] = self.defocus_line_mm();
        self.focal_length_mm + self.focal_length_mm * self.focal_length_mm / (offset + slope * alpha)
    }

    /// Normalised depth of an object at `depth_mm`; NaN at or inside the focal length.
    pub fn alpha(&self, depth_mm: f64) -> f64 {
        if depth_mm <= self.focal_length_mm {
            return f64::NAN;
        }
        let [offset, slope] = self.defocus_line_mm();
        (self.focal_length_mm * self.focal_length_mm / (depth_mm - self.focal_length_mm) - offset) / slope
    }

    /// `[offset, slope]` of `w - F = offset + slope alpha` in mm. The form without `w` itself loses no digits in
    /// single precision: depth is `F + F^2 / (w - F)`.
    pub fn defocus_line_mm(&self) -> [f64; 2] {
        let e = self.half_travel_mm();
        let from_focal = self.focal_length_mm * self.focal_length_mm / (self.far_mm - self.focal_length_mm);
        [from_focal + e, e]
    }

    /// Slope of depth against alpha in mm at `alpha` (negative: alpha rises towards the camera).
    pub fn depth_per_alpha_mm(&self, alpha: f64) -> f64 {
        let [offset, slope] = self.defocus_line_mm();
        let w = offset + slope * alpha;
        -self.focal_length_mm * self.focal_length_mm * slope / (w * w)
    }

    /// Blur radii `[R1, R2]` in pixels of the far- and the near-focused image at `alpha`; signed, so that a value
    /// beyond the working range stays linear (an OTF takes the magnitude).
    pub fn blur_px(&self, alpha: f64) -> [f64; 2] {
        [0.5 * (1.0 + alpha) * self.max_blur_px, 0.5 * (1.0 - alpha) * self.max_blur_px]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Li 2014's rig (section 5.3); the distances were worked out by hand from the thin lens.
    const RIG: &str = "
        [lens]
        focal_length_mm = 50.0
        aperture_mm = 12.8
        [sensor]
        pixel_um = 7.4
        [focus]
        far_mm = 933.0
        max_blur_px = 2.703
        [psf]
        model = \"generalised\"
        p = 1.8
        k = 0.4802
    ";

    fn rig() -> OpticsFile {
        toml::from_str(RIG).unwrap()
    }

    #[test]
    fn the_rig_of_the_thesis_has_its_distances() {
        let optics = rig().check().unwrap();
        assert!((optics.f_number() - 3.90625).abs() < 1e-12);
        let range = optics.working_range();
        for (got, want) in [
            (range.sensor_far_mm, 52.8313),
            (range.sensor_near_mm, 52.9875),
            (range.near_mm, 886.81),
            (range.alpha0_mm, 909.29),
        ] {
            // The reference figures carry four and two decimals.
            assert!((got - want).abs() < if want < 100.0 { 1e-4 } else { 6e-3 }, "{got} for {want}");
        }
        assert!((range.sensor_travel_mm - 0.15627).abs() < 1e-5);
    }

    #[test]
    fn depth_and_alpha_are_inverse_and_alpha_rises_towards_the_camera() {
        let optics = rig().check().unwrap();
        for i in 0..=24 {
            let alpha = -1.2 + 0.1 * f64::from(i);
            assert!((optics.alpha(optics.depth_mm(alpha)) - alpha).abs() < 1e-10);
            let slope = (optics.depth_mm(alpha + 1e-4) - optics.depth_mm(alpha - 1e-4)) / 2e-4;
            assert!((slope - optics.depth_per_alpha_mm(alpha)).abs() < 1e-5);
            assert!(slope < 0.0);
        }
        assert!(optics.alpha(49.0).is_nan());
    }

    #[test]
    fn near_distance_and_blur_follow_from_each_other() {
        let mut file = rig();
        let near_mm = file.check().unwrap().working_range().near_mm;
        file.focus = FocusSection { far_mm: 933.0, max_blur_px: None, near_mm: Some(near_mm) };
        assert!((file.check().unwrap().max_blur_px() - 2.703).abs() < 1e-9);
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
        let optics = rig().check().unwrap();
        let text = toml::to_string(&optics).unwrap();
        assert_eq!(toml::from_str::<Optics>(&text).unwrap(), optics);
    }
}
