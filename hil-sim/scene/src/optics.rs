//! `optics.toml`: lens, pixel and the two focus settings of a rig. Lengths in mm, pixel pitch in um, largest
//! blur in px. Near focus and largest blur determine each other (Li 2014, eq. 4.3): between the settings the
//! sensor moves by twice the f-number times the blur radius that each gives on the other's plane.

use serde::Deserialize;
use thiserror::Error;

use crate::psf::{Psf, PsfError};

/// Tolerated relative disagreement of dependent values.
const AGREEMENT: f64 = 0.02;

/// Checked contents of an `optics.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct OpticsFile {
    /// Focal length of the thin lens, mm.
    pub focal_length_mm: f64,
    /// Diameter of the aperture, mm.
    pub aperture_mm: f64,
    /// Distance of neighbouring pixels, um.
    pub pixel_um: f64,
    /// In-focus object distance of the far setting, mm.
    pub far_mm: f64,
    /// In-focus object distance of the near setting, mm.
    pub near_mm: f64,
    /// Blur radius of either focused plane at the other setting, px.
    pub max_blur_px: f64,
    /// The PSF of `[psf]`, if present.
    pub psf: Option<Psf>,
    /// Whether moving the sensor keeps the magnification, if stated.
    pub telecentric: Option<bool>,
}

/// Why an `optics.toml` was rejected. The messages equal those of the depth crate's reader (tested there).
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum OpticsError {
    #[error("{0}")]
    Syntax(String),
    #[error("[{section}] {name} = {value}: must be a positive, finite number{unit}")]
    NotPositive { section: &'static str, name: &'static str, value: f64, unit: &'static str },
    #[error("[lens] needs aperture_mm or f_number")]
    NoAperture,
    #[error(
        "[lens] aperture_mm = {aperture_mm} and f_number = {f_number} disagree: with focal_length_mm = \
         {focal_length_mm} that aperture is f_number = {implied:.5}; give one of them"
    )]
    ApertureDisagreement { focal_length_mm: f64, aperture_mm: f64, f_number: f64, implied: f64 },
    #[error(
        "[focus] {name} = {distance_mm} is not beyond the focal length of {focal_length_mm} mm: no real image forms"
    )]
    InsideFocalLength { name: &'static str, distance_mm: f64, focal_length_mm: f64 },
    #[error(
        "[focus] near_mm = {near_mm} is not nearer than far_mm = {far_mm}: the near focus must be the smaller distance"
    )]
    NearBeyondFar { near_mm: f64, far_mm: f64 },
    #[error("[focus] needs max_blur_px or near_mm")]
    NoRange,
    #[error(
        "[focus] max_blur_px = {given_px} and near_mm = {near_mm} disagree by {percent:.1} % (2 % allowed): \
         near_mm = {implied_near_mm:.2} would agree with that blur, max_blur_px = {implied_px:.4} with that distance"
    )]
    Disagreement { given_px: f64, near_mm: f64, percent: f64, implied_px: f64, implied_near_mm: f64 },
    #[error("[psf] {0}")]
    Psf(#[from] PsfError),
}

impl OpticsFile {
    /// Parses an `optics.toml`. `max_blur_px` takes precedence over `near_mm`, `f_number` over `aperture_mm`.
    pub fn parse(text: &str) -> Result<Self, OpticsError> {
        let raw: RawFile =
            toml::from_str(text).map_err(|error| OpticsError::Syntax(error.to_string().trim_end().into()))?;
        let focal_length_mm = positive("lens", "focal_length_mm", raw.lens.focal_length_mm, " of mm")?;
        let aperture_mm = raw.lens.aperture(focal_length_mm)?;
        let pixel_um = positive("sensor", "pixel_um", raw.sensor.pixel_um, " of um")?;
        let far_mm = positive("focus", "far_mm", raw.focus.far_mm, " of mm")?;
        beyond_focal_length("far_mm", far_mm, focal_length_mm)?;
        let psf = raw.psf.map(|psf| Psf::from_parts(&psf.model, psf.p, psf.k, psf.inner)).transpose()?;
        let f_number = focal_length_mm / aperture_mm;
        let travel = Travel {
            focal_length_mm,
            sensor_far_mm: image_distance_mm(focal_length_mm, far_mm),
            per_blur_mm: 2.0 * f_number * pixel_um * 1e-3,
            telecentric: raw.lens.telecentric.unwrap_or(true),
        };
        let (near_mm, max_blur_px) = raw.focus.range(&travel)?;
        let bin = f64::from(raw.stage.map_or(1, |stage| stage.bin.max(1)));
        let (pixel_um, max_blur_px) = (pixel_um / bin, max_blur_px * bin);
        let telecentric = raw.lens.telecentric;
        Ok(Self { focal_length_mm, aperture_mm, pixel_um, far_mm, near_mm, max_blur_px, psf, telecentric })
    }
}

/// Image distance of an object at `object_mm`, mm: `1/F = 1/u + 1/w`.
#[must_use]
pub fn image_distance_mm(focal_length_mm: f64, object_mm: f64) -> f64 {
    1.0 / (1.0 / focal_length_mm - 1.0 / object_mm)
}

struct Travel {
    focal_length_mm: f64,
    sensor_far_mm: f64,
    /// Travel per px of the largest blur of a telecentric lens.
    per_blur_mm: f64,
    telecentric: bool,
}

impl Travel {
    fn near_mm(&self, blur_px: f64) -> f64 {
        let telecentric_mm = self.per_blur_mm * blur_px;
        let travel_mm = if self.telecentric {
            telecentric_mm
        } else {
            telecentric_mm * self.sensor_far_mm / (self.focal_length_mm - 0.5 * telecentric_mm)
        };
        1.0 / (1.0 / self.focal_length_mm - 1.0 / (self.sensor_far_mm + travel_mm))
    }

    /// The cone of light has its tip in the image and its base in the aperture: at the lens, or at the front focal plane
    /// of a telecentric lens.
    fn blur_px(&self, near_mm: f64) -> f64 {
        let travel_mm = image_distance_mm(self.focal_length_mm, near_mm) - self.sensor_far_mm;
        let cone_mm =
            if self.telecentric { self.focal_length_mm } else { self.sensor_far_mm + 0.5 * travel_mm };
        travel_mm / self.per_blur_mm * self.focal_length_mm / cone_mm
    }
}

impl RawLens {
    fn aperture(&self, focal_length_mm: f64) -> Result<f64, OpticsError> {
        let given = self.aperture_mm.map(|a| positive("lens", "aperture_mm", a, " of mm")).transpose()?;
        let f_number = self.f_number.map(|f| positive("lens", "f_number", f, "")).transpose()?;
        match (given, f_number) {
            (None, None) => Err(OpticsError::NoAperture),
            (Some(aperture_mm), None) => Ok(aperture_mm),
            (None, Some(f_number)) => Ok(focal_length_mm / f_number),
            (Some(aperture_mm), Some(f_number)) => {
                let implied = focal_length_mm / aperture_mm;
                if (f_number - implied).abs() > AGREEMENT * implied {
                    return Err(OpticsError::ApertureDisagreement {
                        focal_length_mm,
                        aperture_mm,
                        f_number,
                        implied,
                    });
                }
                Ok(focal_length_mm / f_number)
            }
        }
    }
}

impl RawFocus {
    fn range(&self, travel: &Travel) -> Result<(f64, f64), OpticsError> {
        let given_px = self.max_blur_px.map(|r| positive("focus", "max_blur_px", r, " of px")).transpose()?;
        let near_mm = self.near_mm.map(|u| positive("focus", "near_mm", u, " of mm")).transpose()?;
        let Some(near_mm) = near_mm else {
            let blur_px = given_px.ok_or(OpticsError::NoRange)?;
            return Ok((travel.near_mm(blur_px), blur_px));
        };
        beyond_focal_length("near_mm", near_mm, travel.focal_length_mm)?;
        if near_mm >= self.far_mm {
            return Err(OpticsError::NearBeyondFar { near_mm, far_mm: self.far_mm });
        }
        let implied_px = travel.blur_px(near_mm);
        let Some(given_px) = given_px else { return Ok((near_mm, implied_px)) };
        let implied_near_mm = travel.near_mm(given_px);
        let difference = (given_px - implied_px).abs() / implied_px;
        if difference > AGREEMENT {
            let percent = 100.0 * difference;
            return Err(OpticsError::Disagreement {
                given_px,
                near_mm,
                percent,
                implied_px,
                implied_near_mm,
            });
        }
        Ok((implied_near_mm, given_px))
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

fn beyond_focal_length(
    name: &'static str,
    distance_mm: f64,
    focal_length_mm: f64,
) -> Result<(), OpticsError> {
    if distance_mm > focal_length_mm {
        Ok(())
    } else {
        Err(OpticsError::InsideFocalLength { name, distance_mm, focal_length_mm })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    lens: RawLens,
    sensor: RawSensor,
    focus: RawFocus,
    psf: Option<RawPsf>,
    /// A calibrated lens counts binned pixels; the camera has its own.
    stage: Option<RawStage>,
    /// Of the rig's commands.
    #[serde(default, rename = "light")]
    _light: serde::de::IgnoredAny,
}

#[derive(Deserialize)]
struct RawStage {
    bin: u16,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLens {
    focal_length_mm: f64,
    aperture_mm: Option<f64>,
    f_number: Option<f64>,
    telecentric: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSensor {
    pixel_um: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFocus {
    far_mm: f64,
    near_mm: Option<f64>,
    max_blur_px: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPsf {
    model: String,
    p: Option<f64>,
    k: Option<f64>,
    inner: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn file(lens: &str, focus: &str) -> String {
        format!("[lens]\nfocal_length_mm = 50.0\n{lens}\n[sensor]\npixel_um = 7.4\n[focus]\n{focus}\n")
    }

    /// The sensor's travel and the near plane stay; pixels are those of the camera.
    #[test]
    fn a_calibrated_lens_has_the_pixels_of_the_camera() {
        let text = file("f_number = 4.0", "far_mm = 933.0\nmax_blur_px = 2.5");
        let [plain, calibrated] = ["", "[stage]\nbin = 2\npair_step = 5\n"]
            .map(|stage| OpticsFile::parse(&(text.clone() + stage)).unwrap());
        assert_eq!((calibrated.pixel_um, calibrated.max_blur_px), (3.7, 5.0));
        assert_eq!(calibrated.near_mm, plain.near_mm);
    }

    #[test]
    fn f_number_and_aperture_are_equivalent() {
        let by_aperture =
            OpticsFile::parse(&file("aperture_mm = 12.8", "far_mm = 933.0\nmax_blur_px = 2.703"));
        let by_number = OpticsFile::parse(&file("f_number = 3.90625", "far_mm = 933.0\nmax_blur_px = 2.703"));
        assert_eq!(by_aperture, by_number);
    }

    #[test]
    fn near_and_blur_follow_from_each_other() {
        let near =
            OpticsFile::parse(&file("aperture_mm = 12.8", "far_mm = 933.0\nnear_mm = 886.81")).unwrap();
        assert!((near.max_blur_px - 2.703).abs() < 1e-3, "{}", near.max_blur_px);
        let back = format!("far_mm = 933.0\nmax_blur_px = {}", near.max_blur_px);
        let blur = OpticsFile::parse(&file("aperture_mm = 12.8", &back)).unwrap();
        assert!((blur.near_mm - 886.81).abs() < 1e-9);
    }

    #[test]
    fn watanabe_and_nayars_pair_agrees_with_its_own_blur() {
        let text = "[lens]\nfocal_length_mm = 25.0\nf_number = 8.3\n[sensor]\npixel_um = 13.04\n\
                    [focus]\nfar_mm = 869.0\nnear_mm = 529.0\nmax_blur_px = 2.307\n[psf]\nmodel = \"pillbox\"";
        let optics = OpticsFile::parse(text).unwrap();
        assert_eq!(optics.max_blur_px, 2.307);
        assert!((optics.near_mm - 529.0).abs() < 0.1, "{}", optics.near_mm);
        assert_eq!(optics.psf, Some(Psf::PillBox));
    }

    #[test]
    fn contradiction_names_the_value_that_would_agree() {
        let error = OpticsFile::parse(&file(
            "aperture_mm = 12.8",
            "far_mm = 933.0\nnear_mm = 886.81\nmax_blur_px = 2.4",
        ))
        .unwrap_err();
        let text = error.to_string();
        assert!(text.contains("2.703"), "{text}");
        assert!(text.contains("891."), "{text}");
    }

    #[test]
    fn rejects_invalid_optics_by_name() {
        let cases = [
            ("aperture_mm = 12.8", "far_mm = 933.0\nnear_mm = 940.0", "not nearer than far_mm = 933"),
            ("f_number = 0.0", "far_mm = 933.0\nmax_blur_px = 2.7", "f_number = 0"),
            ("aperture_mm = -1.0", "far_mm = 933.0\nmax_blur_px = 2.7", "aperture_mm = -1"),
            ("aperture_mm = 12.8", "far_mm = 50.0\nmax_blur_px = 2.7", "focal length of 50"),
            ("aperture_mm = 12.8", "far_mm = 933.0\nnear_mm = 12.0", "near_mm = 12"),
            ("aperture_mm = 12.8", "far_mm = nan\nmax_blur_px = 2.7", "far_mm = NaN"),
            ("aperture_mm = 12.8", "far_mm = 933.0", "max_blur_px or near_mm"),
            ("", "far_mm = 933.0\nmax_blur_px = 2.7", "aperture_mm or f_number"),
            ("aperture_mm = 12.8\nf_number = 4.0", "far_mm = 933.0\nmax_blur_px = 2.7", "f_number = 3.90625"),
            ("aperture = 12.8", "far_mm = 933.0\nmax_blur_px = 2.7", "unknown field `aperture`"),
        ];
        for (lens, focus, expected) in cases {
            let text = OpticsFile::parse(&file(lens, focus)).unwrap_err().to_string();
            assert!(text.contains(expected), "{text:?} should contain {expected:?}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_answered(text in "\\PC*") {
            let _ = OpticsFile::parse(&text);
        }

        #[test]
        fn any_numbers_give_a_sensible_range_or_an_error(
            focal in -10.0..200.0f64, number in -1.0..30.0f64, pixel in -1.0..30.0f64,
            far in -10.0..5000.0f64, blur in -1.0..10.0f64,
        ) {
            let text = format!(
                "[lens]\nfocal_length_mm = {focal:?}\nf_number = {number:?}\n[sensor]\npixel_um = {pixel:?}\n\
                 [focus]\nfar_mm = {far:?}\nmax_blur_px = {blur:?}"
            );
            if let Ok(optics) = OpticsFile::parse(&text) {
                prop_assert!(optics.near_mm > optics.focal_length_mm && optics.near_mm < optics.far_mm);
            }
        }
    }
}
