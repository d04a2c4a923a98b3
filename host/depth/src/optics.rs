//! Thin-lens geometry of a depth-from-defocus pair whose *sensor* moves.
//!
//! The far-focused image is taken with the sensor at `s1`, the near-focused one at `s2 = s1 + 2e`. An object imaged at
//! the distance `w` from the lens has the normalised depth `alpha` with `w = s1 + (1 + alpha) e`: -1 at the far focus,
//! +1 at the near focus, rising as the object comes nearer. The blur radii are `R1 = (1 + alpha) e / (2 Fe)` and
//! `R2 = (1 - alpha) e / (2 Fe)`, so `2e = 2 Fe Rmax` (Li 2014, eqs. 4.1, 4.3 and 5.11; the thin lens is
//! `1/F = 1/u + 1/w`). `Fe` is the f-number of a lens that is telecentric on the image side; an aperture at the lens makes it
//! `(s1 + e) / F` times larger. Units: millimetres unless a name says otherwise; blur radii in pixels. Every function is O(1).

mod distortion;
mod doubt;
mod error;
mod file;
mod stage;

use serde::{Deserialize, Serialize};

use crate::psf::Psf;

pub use distortion::{Distortion, DistortionSection};
pub use doubt::Doubt;
pub use error::OpticsError;
pub use file::{FocusSection, LensSection, LightSection, OpticsFile, SensorSection};
pub use stage::{Astigmatism, Coarser, RESPONSE_POINTS, Stage, unexplained};

/// A column or row, whose pixel's centre is an integer, in images with `bin` x `bin` pixels averaged into one; with `1 / bin` the way back.
pub fn binned_place(place: f64, bin: f64) -> f64 {
    (place + 0.5) / bin - 0.5
}

/// Image distance of an object at `object_mm`; the thin lens is its own inverse, so this also maps back.
fn image_mm(focal_length_mm: f64, object_mm: f64) -> f64 {
    focal_length_mm + focal_length_mm * focal_length_mm / (object_mm - focal_length_mm)
}

/// Checked, consistent optics of a pair, made by [`OpticsFile::check`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "OpticsFile", into = "OpticsFile")]
pub struct Optics {
    focal_length_mm: f64,
    f_number: f64,
    pixel_um: f64,
    far_mm: f64,
    max_blur_px: f64,
    psf: Psf,
    telecentric: Option<bool>,
    distortion: Option<Distortion>,
    stage: Option<Stage>,
}

/// The range of distances of a pair, and the sensor positions for them.
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
    /// Object distance of alpha = 0, not the middle of the range in millimetres.
    pub alpha0_mm: f64,
}

/// Largest blur radius that 7x7 operators can use, px: at 6 px most of a scene has no depth.
pub const USABLE_BLUR_PX: f64 = 4.5;

impl Optics {
    /// Focal length F in mm.
    pub fn focal_length_mm(&self) -> f64 {
        self.focal_length_mm
    }

    /// f-number, the focal length over the diameter of the aperture.
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

    /// Whether the lens is telecentric on the image side; `None` where the optics file does not say.
    pub fn telecentric(&self) -> Option<bool> {
        self.telecentric
    }

    /// Distortion of the lens, where the optics file names one.
    pub fn distortion(&self) -> Option<Distortion> {
        self.distortion
    }

    /// The response learned from a z-stack, if any.
    pub fn stage(&self) -> Option<&Stage> {
        self.stage.as_ref()
    }

    /// The same optics with another response.
    pub fn with_stage(self, stage: Stage) -> Self {
        Self { stage: Some(stage), ..self }
    }

    /// Centre of projection before the lens and its principal distance, mm: a pixel of pitch p sees `p (z - centre) / distance` of
    /// the object at depth z. Rays of a lens that is telecentric on the image side meet in its front focus, those through an
    /// aperture at the lens in the lens. For the latter the distance is that of the far image's sensor: alignment scales the near
    /// image to it.
    pub fn projection_mm(&self) -> [f64; 2] {
        let focal_length_mm = self.focal_length_mm;
        match self.telecentric {
            Some(false) => [0.0, focal_length_mm * self.far_mm / (self.far_mm - focal_length_mm)],
            Some(true) | None => [focal_length_mm; 2],
        }
    }

    /// Side of a pixel at the object at `depth_mm`, mm.
    pub fn pixel_at_object_mm(&self, depth_mm: f64) -> f64 {
        let [centre_mm, distance_mm] = self.projection_mm();
        self.pixel_um * 1e-3 * (depth_mm - centre_mm) / distance_mm
    }

    /// Magnification of the near relative to the far image without telecentricity: the ratio of the sensor distances.
    pub fn magnification_ratio(&self) -> f64 {
        let range = self.working_range();
        range.sensor_near_mm / range.sensor_far_mm
    }

    /// The same geometry with another point-spread function.
    pub fn with_psf(self, psf: Psf) -> Self {
        Self { psf, ..self }
    }

    /// The same optics for images with `bin` x `bin` pixels averaged into one.
    pub fn binned(self, bin: usize) -> Self {
        let bin = bin.max(1) as f64;
        let distortion = self.distortion.map(|distortion| distortion.binned(bin));
        Self { pixel_um: self.pixel_um * bin, max_blur_px: self.max_blur_px / bin, distortion, ..self }
    }

    /// The optics of images that are not averaged, from those of a lens with a learned response, which is dropped: it is of
    /// averaged pixels. Unchanged without a response.
    pub fn unbinned(self) -> Self {
        let Some(stage) = self.stage else { return self };
        let bin = stage.bin as f64;
        let distortion = self.distortion.map(|distortion| distortion.binned(1.0 / bin));
        let (pixel_um, max_blur_px) = (self.pixel_um / bin, self.max_blur_px * bin);
        Self { pixel_um, max_blur_px, distortion, stage: None, ..self }
    }

    /// The blur is `travel / (2 F_e)`. The cone of light of a telecentric lens is as long as the focal length: `F_e` is the
    /// f-number `N`. That of an aperture at the lens is as long as the image distance: `F_e = N (s_1 + e) / F` in the middle
    /// of the travel.
    fn half_travel_mm(&self) -> f64 {
        let telecentric_mm = self.f_number * self.max_blur_px * self.pixel_um * 1e-3;
        match self.telecentric {
            Some(false) => {
                let sensor_far_mm = image_mm(self.focal_length_mm, self.far_mm);
                telecentric_mm * sensor_far_mm / (self.focal_length_mm - telecentric_mm)
            }
            Some(true) | None => telecentric_mm,
        }
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

    /// `[far, near]` object distances in mm at `-alpha` and `alpha`. The far one is infinite where the image would be nearer to the
    /// lens than that of an object at infinity: `depth_mm` turns negative there.
    pub fn range_mm(&self, alpha: f64) -> [f64; 2] {
        let [far_mm, near_mm] = [-alpha, alpha].map(|alpha| self.depth_mm(alpha));
        [if far_mm < self.focal_length_mm { f64::INFINITY } else { far_mm }, near_mm]
    }

    /// Normalised depth of an object at `depth_mm`; NaN at or inside the focal length.
    pub fn alpha(&self, depth_mm: f64) -> f64 {
        if depth_mm <= self.focal_length_mm {
            return f64::NAN;
        }
        let [offset, slope] = self.defocus_line_mm();
        (self.focal_length_mm * self.focal_length_mm / (depth_mm - self.focal_length_mm) - offset) / slope
    }

    /// `[offset, slope]` of `w - F = offset + slope alpha` in mm, without cancellation: depth is `F + F^2 / (w - F)`.
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

    /// Magnitude of the slope of depth against alpha, which is `steepness (z - F)^2` at the depth z, 1/mm.
    pub fn steepness(&self) -> f64 {
        let [_, slope] = self.defocus_line_mm();
        slope.abs() / self.focal_length_mm.powi(2)
    }

    /// Signed blur radii `[R1, R2]` in pixels at `alpha`, linear beyond the working range (an OTF takes the magnitude).
    pub fn blur_px(&self, alpha: f64) -> [f64; 2] {
        [0.5 * (1.0 + alpha) * self.max_blur_px, 0.5 * (1.0 - alpha) * self.max_blur_px]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Li 2014's rig (section 5.3); distances calculated by hand from the thin lens.
    pub(super) const RIG: &str = "
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

    pub(super) fn rig() -> OpticsFile {
        toml::from_str(RIG).unwrap()
    }

    #[test]
    fn chief_rays_meet_in_the_front_focus_or_in_the_lens() {
        let mut file = rig();
        let pixel_mm = |file: &OpticsFile, depth_mm| file.check().unwrap().pixel_at_object_mm(depth_mm);
        assert!((pixel_mm(&file, 890.0) - 7.4e-3 * 840.0 / 50.0).abs() < 1e-9);
        let telecentric = pixel_mm(&file, 933.0);
        file.lens.telecentric = Some(false);
        // The image of the far focus is equally large; its sensor is 52.8313 mm behind the lens.
        assert!((pixel_mm(&file, 933.0) - telecentric).abs() < 1e-9);
        assert!((pixel_mm(&file, 890.0) - 7.4e-3 * 890.0 / 52.8313).abs() < 1e-6);
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
    fn a_learned_lens_has_its_geometry_without_averaging() {
        let optics = rig().check().unwrap();
        assert_eq!(optics.unbinned(), optics);
        let learned = optics.binned(4).with_stage(Stage::identity(4, 2));
        assert_eq!(learned.unbinned(), optics);
    }

    #[test]
    fn a_range_beyond_a_distant_focus_reaches_infinity() {
        let mut file = rig();
        file.focus = FocusSection { far_mm: 933.0, max_blur_px: None, near_mm: Some(886.81) };
        let optics = file.check().unwrap();
        assert_eq!(optics.range_mm(1.1), [optics.depth_mm(-1.1), optics.depth_mm(1.1)]);
        // With a far focus of more than some 21 near ones, a tenth beyond it lies beyond infinity.
        file.focus = FocusSection { far_mm: 30_000.0, max_blur_px: None, near_mm: Some(1000.0) };
        let optics = file.check().unwrap();
        let [far_mm, near_mm] = optics.range_mm(1.1);
        assert!(far_mm == f64::INFINITY && optics.depth_mm(-1.1) < 0.0, "{far_mm}");
        assert!((900.0..1000.0).contains(&near_mm), "{near_mm}");
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
}
