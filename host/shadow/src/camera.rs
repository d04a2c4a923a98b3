//! Camera file (TOML): pose of the camera and prior knowledge of the subject.
//! ```toml
//! [camera]
//! height_m = 0.8                        # lens above the ground
//! azimuth_deg = 140.0                   # viewing direction, anticlockwise from north
//! pitch_deg = 0.0                       # optional: downwards positive
//! focal_length_mm = 4.0
//! pixel_um = 6.0                        # pitch of the pixels
//! width_px = 640                        # optional: 640
//! height_px = 480                       # optional: 480
//! principal_point_px = [319.5, 239.5]   # default: the middle
//! ```
//! Two tables are optional: `subject` with `height_m` (1.75), `head_width_m` (0.17) and `distance_m` (without it
//! estimated from the head), and `standard_deviations` with the fields of [`StandardDeviations`].

use crate::sun::SunPosition;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    pub height_m: f64,
    /// Viewing direction, anticlockwise from north (Li 2014, eq. 8.12).
    pub azimuth_deg: f64,
    #[serde(default)]
    pub pitch_deg: f64,
    /// Also the image distance v, as subjects are far.
    pub focal_length_mm: f64,
    pub pixel_um: f64,
    #[serde(default = "default_width")]
    pub width_px: usize,
    #[serde(default = "default_height")]
    pub height_px: usize,
    #[serde(default)]
    pub principal_point_px: Option<[f64; 2]>,
}

fn default_width() -> usize {
    640
}
fn default_height() -> usize {
    480
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubjectPrior {
    pub height_m: f64,
    pub head_width_m: f64,
    /// Distance from the lens along the ground; `None`: from the head's width and row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_m: Option<f64>,
}

impl Default for SubjectPrior {
    fn default() -> Self {
        Self { height_m: 1.75, head_width_m: 0.17, distance_m: None }
    }
}

/// Standard deviations of all inputs (Li 2014, eq. 8.23 to 8.37).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StandardDeviations {
    pub day: f64,
    pub time_h: f64,
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    pub subject_height_m: f64,
    pub camera_height_m: f64,
    pub azimuth_deg: f64,
    pub head_width_m: f64,
    pub head_width_px: f64,
    pub image_distance_um: f64,
}

impl Default for StandardDeviations {
    fn default() -> Self {
        Self {
            day: 0.3,
            time_h: 0.05,
            latitude_deg: 0.05,
            longitude_deg: 0.05,
            subject_height_m: 0.07,
            camera_height_m: 0.05,
            azimuth_deg: 2.0,
            head_width_m: 0.012,
            head_width_px: 0.5,
            image_distance_um: 20.0,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraFile {
    pub camera: Camera,
    #[serde(default)]
    pub subject: SubjectPrior,
    #[serde(default)]
    pub standard_deviations: StandardDeviations,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    #[error("camera file: {0}")]
    Syntax(String),
    #[error("camera file: {name} = {value} is not {expected}")]
    Range { name: &'static str, value: f64, expected: &'static str },
}

impl CameraFile {
    /// Fails for invalid TOML, unknown keys and numbers out of range.
    pub fn parse(text: &str) -> Result<Self, CameraError> {
        let file: Self = toml::from_str(text).map_err(|error| CameraError::Syntax(error.to_string()))?;
        file.check()?;
        Ok(file)
    }

    pub fn check(&self) -> Result<(), CameraError> {
        let c = &self.camera;
        let within = |name, value: f64, low: f64, high: f64, expected| {
            if value > low && value < high {
                Ok(())
            } else {
                Err(CameraError::Range { name, value, expected })
            }
        };
        within("camera.height_m", c.height_m, 0.0, 100.0, "above 0 and below 100 m")?;
        within("camera.azimuth_deg", c.azimuth_deg, -720.5, 720.5, "an angle in degrees")?;
        within("camera.pitch_deg", c.pitch_deg, -80.0, 80.0, "between -80 and 80 deg (downwards positive)")?;
        within("camera.focal_length_mm", c.focal_length_mm, 0.1, 2e3, "a focal length of 0.1 to 2000 mm")?;
        within("camera.pixel_um", c.pixel_um, 0.1, 1e3, "a pixel pitch of 0.1 to 1000 um")?;
        within("camera.width_px", c.width_px as f64, 0.0, 1e5, "an image width in pixels")?;
        within("camera.height_px", c.height_px as f64, 0.0, 1e5, "an image height in pixels")?;
        within("subject.height_m", self.subject.height_m, 0.2, 3.0, "a stature in metres")?;
        within("subject.head_width_m", self.subject.head_width_m, 0.02, 1.0, "a head's width in metres")?;
        if let Some(distance_m) = self.subject.distance_m {
            within("subject.distance_m", distance_m, 0.2, 1000.0, "a distance of 0.2 to 1000 m")?;
        }
        let s = &self.standard_deviations;
        for (name, value) in [
            ("standard_deviations.day", s.day),
            ("standard_deviations.time_h", s.time_h),
            ("standard_deviations.latitude_deg", s.latitude_deg),
            ("standard_deviations.longitude_deg", s.longitude_deg),
            ("standard_deviations.subject_height_m", s.subject_height_m),
            ("standard_deviations.camera_height_m", s.camera_height_m),
            ("standard_deviations.azimuth_deg", s.azimuth_deg),
            ("standard_deviations.head_width_m", s.head_width_m),
            ("standard_deviations.head_width_px", s.head_width_px),
            ("standard_deviations.image_distance_um", s.image_distance_um),
        ] {
            within(name, value, -f64::MIN_POSITIVE, 1e6, "zero or positive")?;
        }
        Ok(())
    }
}

impl Camera {
    pub fn focal_px(&self) -> f64 {
        1e3 * self.focal_length_mm / self.pixel_um
    }

    pub fn principal_point(&self) -> [f64; 2] {
        self.principal_point_px
            .unwrap_or([0.5 * (self.width_px as f64 - 1.0), 0.5 * (self.height_px as f64 - 1.0)])
    }

    /// Depth of a world point (metres; x right, y forward, z up, origin on the ground under the lens).
    pub fn depth_m(&self, point: [f64; 3]) -> f64 {
        let (s, c) = self.pitch_deg.to_radians().sin_cos();
        point[1] * c + (self.height_m - point[2]) * s
    }

    /// Pixel position of a world point; `None` nearer than 1 cm along the axis.
    pub fn project(&self, point: [f64; 3]) -> Option<[f64; 2]> {
        let depth = self.depth_m(point);
        if depth.is_nan() || depth <= 0.01 {
            return None;
        }
        let (s, c) = self.pitch_deg.to_radians().sin_cos();
        let down = -point[1] * s + (self.height_m - point[2]) * c;
        let [cx, cy] = self.principal_point();
        Some([cx + self.focal_px() * point[0] / depth, cy + self.focal_px() * down / depth])
    }

    /// Whether the sun is in the image: its glare damages masks, and all shadows point to the camera.
    pub fn sees_sun(&self, sun: SunPosition) -> bool {
        let (sin_e, cos_e) = sun.elevation_deg.to_radians().sin_cos();
        // The camera's azimuth is anticlockwise.
        let (right, forward) = (sun.azimuth_deg + self.azimuth_deg).to_radians().sin_cos();
        const FAR_M: f64 = 1e9;
        let at = [FAR_M * cos_e * right, FAR_M * cos_e * forward, FAR_M * sin_e];
        self.project(at).is_some_and(|[x, y]| {
            (0.0..self.width_px as f64).contains(&x) && (0.0..self.height_px as f64).contains(&y)
        })
    }

    /// Ground point seen by a pixel, `[x, y]` in metres; `None` at or above the horizon.
    pub fn ground_point(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let [cx, cy] = self.principal_point();
        let (right, down) = ((pixel[0] - cx) / self.focal_px(), (pixel[1] - cy) / self.focal_px());
        let (s, c) = self.pitch_deg.to_radians().sin_cos();
        let fall = s + down * c;
        if fall.is_nan() || fall <= 1e-6 {
            return None;
        }
        let scale = self.height_m / fall;
        Some([scale * right, scale * (c - down * s)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "[camera]\nheight_m = 0.8\nazimuth_deg = 140.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";

    #[test]
    fn a_short_file_uses_defaults_and_errors_name_the_key() {
        let file = CameraFile::parse(TEXT).expect("valid");
        assert_eq!((file.camera.width_px, file.subject.height_m), (640, 1.75));
        assert!((file.camera.focal_px() - 666.67).abs() < 0.01);
        let bad = CameraFile::parse(&TEXT.replace("0.8", "-0.8")).expect_err("negative height");
        assert!(bad.to_string().contains("camera.height_m = -0.8"), "{bad}");
        assert!(CameraFile::parse(&format!("{TEXT}hight = 3\n")).is_err());
        assert!(CameraFile::parse(&TEXT.replace("4.0", "nan")).is_err());
        for (right, wrong, key) in [
            ("height_m = 0.8", "height_m = 800", "camera.height_m = 800"),
            ("pixel_um = 6.0", "pixel_um = 0.006", "camera.pixel_um = 0.006"),
            ("focal_length_mm = 4.0", "focal_length_mm = 0.004", "camera.focal_length_mm = 0.004"),
        ] {
            let error = CameraFile::parse(&TEXT.replace(right, wrong)).expect_err("another unit").to_string();
            assert!(error.contains(key), "{error}");
        }
    }

    #[test]
    fn detects_the_sun_in_the_field_of_view() {
        let mut camera = CameraFile::parse(TEXT).expect("valid").camera;
        // 140 deg anticlockwise from north is 220 deg clockwise; the field of view is 19.8 deg up and 25.6
        // deg sideways.
        let sees = |camera: &Camera, azimuth_deg, elevation_deg| {
            camera.sees_sun(SunPosition { azimuth_deg, elevation_deg })
        };
        assert!(sees(&camera, 220.0, 15.0) && sees(&camera, 244.0, 5.0) && sees(&camera, 196.0, 5.0));
        assert!(!sees(&camera, 247.0, 5.0) && !sees(&camera, 220.0, 25.0) && !sees(&camera, 40.0, 15.0));
        camera.pitch_deg = -10.0;
        assert!(sees(&camera, 220.0, 25.0));
    }

    #[test]
    fn ground_points_project_back_to_themselves_with_pitch() {
        let mut camera = CameraFile::parse(TEXT).expect("valid").camera;
        for pitch_deg in [0.0, 12.0, -3.0] {
            camera.pitch_deg = pitch_deg;
            let pixel = camera.project([0.7, 6.0, 0.0]).expect("in front");
            let back = camera.ground_point(pixel).expect("below the horizon");
            assert!((back[0] - 0.7).abs() < 1e-9 && (back[1] - 6.0).abs() < 1e-9, "{back:?}");
        }
        assert_eq!(camera.project([0.0, -1.0, 0.0]), None);
        assert_eq!(camera.ground_point([0.0, -4000.0]), None);
    }

    #[test]
    fn each_number_out_of_its_range_is_named() {
        type Change = fn(&mut CameraFile, f64);
        let table: [(&str, f64, Change); 22] = [
            ("camera.height_m", 0.0, |f, v| f.camera.height_m = v),
            ("camera.azimuth_deg", 721.0, |f, v| f.camera.azimuth_deg = v),
            ("camera.pitch_deg", 80.0, |f, v| f.camera.pitch_deg = v),
            ("camera.pitch_deg", -80.0, |f, v| f.camera.pitch_deg = v),
            ("camera.focal_length_mm", 2e3, |f, v| f.camera.focal_length_mm = v),
            ("camera.pixel_um", 1e3, |f, v| f.camera.pixel_um = v),
            ("camera.width_px", 0.0, |f, v| f.camera.width_px = v as usize),
            ("camera.height_px", 0.0, |f, v| f.camera.height_px = v as usize),
            ("subject.height_m", 3.0, |f, v| f.subject.height_m = v),
            ("subject.height_m", 0.2, |f, v| f.subject.height_m = v),
            ("subject.head_width_m", 0.02, |f, v| f.subject.head_width_m = v),
            ("subject.distance_m", 0.2, |f, v| f.subject.distance_m = Some(v)),
            ("standard_deviations.day", -1e-9, |f, v| f.standard_deviations.day = v),
            ("standard_deviations.time_h", -1e-9, |f, v| f.standard_deviations.time_h = v),
            ("standard_deviations.latitude_deg", -1e-9, |f, v| f.standard_deviations.latitude_deg = v),
            ("standard_deviations.longitude_deg", -1e-9, |f, v| f.standard_deviations.longitude_deg = v),
            ("standard_deviations.subject_height_m", -1e-9, |f, v| {
                f.standard_deviations.subject_height_m = v
            }),
            ("standard_deviations.camera_height_m", -1e-9, |f, v| f.standard_deviations.camera_height_m = v),
            ("standard_deviations.azimuth_deg", -1e-9, |f, v| f.standard_deviations.azimuth_deg = v),
            ("standard_deviations.head_width_m", -1e-9, |f, v| f.standard_deviations.head_width_m = v),
            ("standard_deviations.head_width_px", -1e-9, |f, v| f.standard_deviations.head_width_px = v),
            ("standard_deviations.image_distance_um", -1e-9, |f, v| {
                f.standard_deviations.image_distance_um = v
            }),
        ];
        for (name, value, change) in table {
            for wrong in [value, f64::NAN] {
                let mut file = CameraFile::parse(TEXT).expect("valid");
                change(&mut file, wrong);
                let found = file.check();
                assert!(matches!(found, Err(CameraError::Range { name: of, .. }) if of == name), "{found:?}");
            }
        }
        let mut exact = CameraFile::parse(TEXT).expect("valid");
        exact.standard_deviations.day = 0.0;
        assert_eq!(exact.check(), Ok(()));
    }
}
