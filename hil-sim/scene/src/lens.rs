//! The thin lens: blur of an object distance at a sensor position. `1/F = 1/u + 1/w`; mm from the lens, `u` to the object,
//! `w` and `s` to the image. Telecentric on the image side: blur radius `|s - w| D / 2F`; the aperture in the front focal
//! plane makes magnification independent of `s` (Watanabe & Nayar 1997). Otherwise the aperture is at the lens, and the
//! radius is `|s - w| D / 2w`.

use thiserror::Error;

use crate::optics::OpticsFile;
pub use crate::optics::image_distance_mm;

/// Lens with its two focus settings.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "names and types describe these fields")]
pub struct Lens {
    pub focal_length_mm: f64,
    pub aperture_mm: f64,
    pub pixel_mm: f64,
    /// In-focus object distance of the far setting, mm.
    pub far_mm: f64,
    /// In-focus object distance of the near setting, mm.
    pub near_mm: f64,
    /// Sensor distance of the far setting, mm.
    pub sensor_far_mm: f64,
    /// Sensor distance of the near setting, mm; larger than the far one.
    pub sensor_near_mm: f64,
    /// Field dependence of the focus; `None`: flat field.
    pub distortion: Option<EllipticalDistortion>,
    /// Whether moving the sensor keeps the magnification; otherwise the image grows with its distance.
    pub telecentric: bool,
}

/// Why a lens forms no image.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum LensError {
    /// Object at or inside the focal length.
    #[error(
        "an object at {object_mm} mm has no image behind a lens of {focal_length_mm} mm focal length; place it \
         beyond the focal length"
    )]
    NoImage { object_mm: f64, focal_length_mm: f64 },
    #[error("lens: {what} = {value}, expected {expected}")]
    Unusable { what: &'static str, value: f64, expected: &'static str },
}

impl Lens {
    /// The lens of an `optics.toml`, without distortion. Fails for invalid numbers.
    pub fn from_optics(optics: &OpticsFile) -> Result<Self, LensError> {
        let positive = [
            ("focal_length_mm", optics.focal_length_mm),
            ("aperture_mm", optics.aperture_mm),
            ("pixel_um", optics.pixel_um),
        ];
        for (what, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(LensError::Unusable { what, value, expected: "a finite number above 0" });
            }
        }
        let focal_length_mm = optics.focal_length_mm;
        if !(optics.near_mm > focal_length_mm && optics.near_mm < optics.far_mm && optics.far_mm.is_finite())
        {
            return Err(LensError::Unusable {
                what: "near_mm",
                value: optics.near_mm,
                expected: "a distance between the focal length and far_mm",
            });
        }
        Ok(Self {
            focal_length_mm,
            aperture_mm: optics.aperture_mm,
            pixel_mm: optics.pixel_um * 1e-3,
            far_mm: optics.far_mm,
            near_mm: optics.near_mm,
            sensor_far_mm: image_distance_mm(focal_length_mm, optics.far_mm),
            sensor_near_mm: image_distance_mm(focal_length_mm, optics.near_mm),
            distortion: None,
            telecentric: optics.telecentric.unwrap_or(true),
        })
    }

    /// Adds a field dependence of the focus.
    #[must_use]
    pub fn with_distortion(self, distortion: EllipticalDistortion) -> Self {
        Self { distortion: Some(distortion), ..self }
    }

    /// Image distance of an on-axis object, mm; fails at or inside the focal length.
    pub fn image_distance_mm(&self, object_mm: f64) -> Result<f64, LensError> {
        if object_mm.is_finite() && object_mm > self.focal_length_mm {
            Ok(image_distance_mm(self.focal_length_mm, object_mm))
        } else {
            Err(LensError::NoImage { object_mm, focal_length_mm: self.focal_length_mm })
        }
    }

    /// Image distance at the relative image position `x`, `y` (0..1), mm.
    pub(crate) fn distorted_image_distance_mm(&self, image_mm: f64, x: f64, y: f64) -> f64 {
        let Some(distortion) = &self.distortion else { return image_mm };
        let half_travel_mm = 0.5 * (self.sensor_near_mm - self.sensor_far_mm);
        let alpha = (image_mm - self.sensor_far_mm) / half_travel_mm - 1.0;
        self.sensor_far_mm + (1.0 + distortion.apply(alpha, x, y)) * half_travel_mm
    }

    /// Signed blur radius on the sensor, px: positive for objects beyond the focused plane.
    #[must_use]
    pub fn signed_blur_px(&self, sensor_distance_mm: f64, image_mm: f64) -> f64 {
        let cone_mm = if self.telecentric { self.focal_length_mm } else { image_mm };
        (sensor_distance_mm - image_mm) * self.aperture_mm / (2.0 * cone_mm * self.pixel_mm)
    }
}

/// Elliptical field dependence of the focus of simple telecentric lenses (Li 2014, ch. 6).
///
/// Normalised depth `alpha` (-1 at far focus, +1 at near focus), `x`, `y` in 0..1 over the image:
/// `alpha_eff = alpha + offset + 0.5 (curvature + slope alpha) rho2`,
/// `rho2 = ((x - centre_x) / radius_x)^2 + ((y - centre_y) / radius_y)^2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EllipticalDistortion {
    /// Uniform shift of alpha.
    pub offset: f64,
    /// Field curvature at alpha 0.
    pub curvature: f64,
    /// Change of the curvature with alpha.
    pub slope: f64,
    /// Centre relative to the image's width and height.
    pub centre: [f64; 2],
    /// Semi-axes of `rho = 1`, relative to width and height.
    pub radius: [f64; 2],
}

impl Default for EllipticalDistortion {
    /// Used for this project's accuracy figures: uncorrected planes are about 1.9 mm RMS off.
    fn default() -> Self {
        Self { offset: -0.08, curvature: 0.45, slope: -0.20, centre: [0.65, 0.6], radius: [0.75, 0.6] }
    }
}

impl EllipticalDistortion {
    /// Effective normalised depth for `alpha` at `x`, `y` (0..1).
    #[must_use]
    pub fn apply(&self, alpha: f64, x: f64, y: f64) -> f64 {
        let rho2 =
            ((x - self.centre[0]) / self.radius[0]).powi(2) + ((y - self.centre[1]) / self.radius[1]).powi(2);
        alpha + self.offset + 0.5 * (self.curvature + self.slope * alpha) * rho2
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The rig of Li 2014, ch. 4.
    pub(crate) fn thesis_lens() -> Lens {
        Lens::from_optics(&OpticsFile::parse(crate::standard::OPTICS).unwrap()).unwrap()
    }

    #[test]
    fn thesis_rig_has_its_published_distances() {
        let lens = thesis_lens();
        assert!((lens.sensor_far_mm - 52.8313).abs() < 1e-4, "{}", lens.sensor_far_mm);
        assert!((lens.sensor_near_mm - 52.9875).abs() < 1e-4, "{}", lens.sensor_near_mm);
        assert!((lens.sensor_near_mm - lens.sensor_far_mm - 0.15627).abs() < 1e-5);
        assert!((lens.near_mm - 886.81).abs() < 5e-3, "{}", lens.near_mm);
    }

    #[test]
    fn blur_is_zero_in_focus_and_max_blur_at_the_other_setting() {
        let lens = thesis_lens();
        let far = lens.image_distance_mm(lens.far_mm).unwrap();
        assert!(lens.signed_blur_px(lens.sensor_far_mm, far).abs() < 1e-12);
        assert!((lens.signed_blur_px(lens.sensor_near_mm, far) - 2.703).abs() < 1e-9);
        let near = lens.image_distance_mm(lens.near_mm).unwrap();
        assert!((lens.signed_blur_px(lens.sensor_far_mm, near) + 2.703).abs() < 1e-9);
    }

    #[test]
    fn an_aperture_at_the_lens_blurs_by_the_image_distance() {
        let text = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 10.0\ntelecentric = false\n[sensor]\npixel_um = 7.4\n\
                    [focus]\nfar_mm = 150.0\nmax_blur_px = 3.0";
        let lens = Lens::from_optics(&OpticsFile::parse(text).unwrap()).unwrap();
        let [far, near] = [lens.far_mm, lens.near_mm].map(|u| lens.image_distance_mm(u).unwrap());
        let of_far = lens.signed_blur_px(lens.sensor_near_mm, far);
        let of_near = -lens.signed_blur_px(lens.sensor_far_mm, near);
        assert!((of_far - (near - far) * 10.0 / (2.0 * far) / 0.0074).abs() < 1e-9);
        assert!(of_near < 3.0 && of_far > 3.0 && (0.5 * (of_near + of_far) - 3.0).abs() < 1e-3);
    }

    #[test]
    fn objects_inside_the_focal_length_have_no_image() {
        let lens = thesis_lens();
        for object_mm in [50.0, 10.0, -3.0, f64::NAN, f64::INFINITY] {
            assert!(lens.image_distance_mm(object_mm).is_err(), "{object_mm}");
        }
    }

    #[test]
    fn distortion_moves_the_image_by_the_stated_alpha() {
        let lens = thesis_lens().with_distortion(EllipticalDistortion::default());
        let image = lens.image_distance_mm(909.29).unwrap(); // alpha 0
        // At the centre of the ellipses only the offset is left.
        let centre = lens.distorted_image_distance_mm(image, 0.65, 0.6);
        let half_travel = 0.5 * (lens.sensor_near_mm - lens.sensor_far_mm);
        assert!(((centre - image) / half_travel + 0.08).abs() < 1e-9);
        // One semi-axis to the right: offset + 0.5 * 0.45, at alpha 0 (909.29 is it to 1e-4).
        let right = lens.distorted_image_distance_mm(image, 1.4, 0.6);
        assert!(((right - image) / half_travel - (0.225 - 0.08)).abs() < 1e-4);
    }
}
