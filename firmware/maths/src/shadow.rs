//! Shadow of a standing person in a level camera's image, with its standard deviation.
//!
//! On the ground the shadow is `s (-east, -north) / hypot(east, north)`, `s = H / tan(elevation)`; in the camera's
//! frame (x right, y forward; the camera looks `azimuth` anticlockwise from north) `(rx, ry)`. Its end is imaged `mx`,
//! `my` from the feet (Li 2014, eqs. 8.15 and 8.18, the latter corrected for the lateral offset `X0`):
//!
//! `mx = v ((X0 + rx) / (u + ry) - X0 / u)`, `my = Hc v (1 / (u + ry) - 1 / u)`,
//!
//! so `tan(eta) = my / mx = -Hc ry / (u rx - X0 ry)`. The silhouette is rotated by `beta = 3 pi / 4 - eta / 2` (8.20),
//! between 90 and 180 deg, after mirroring if `mx < 0`. The standard deviation is first order ([`Shadow::deviation`]);
//! the result reports where that fails, near the camera or the fold of the mirror. Cost: 880 instructions on a
//! Cortex-M4F, sun included, and 990 for the deviation.

mod deviation;

use core::f32::consts::PI;
use core::fmt;

use crate::angle::{BinaryAngle, atan2_degrees, length};
use crate::sun::{Place, Sun};

pub use deviation::{Deviation, Deviations, Reliability};

/// Lower suns cast shadows beyond nineteen statures, outside any image.
pub const LEAST_ELEVATION_DEG: f32 = 3.0;

/// Camera and subject; lengths in metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Geometry {
    /// Camera azimuth, anticlockwise from north.
    pub azimuth: BinaryAngle,
    /// Height Hc of the lens above the ground.
    pub camera_height_m: f32,
    /// Subject distance u along the optical axis.
    pub distance_m: f32,
    /// Subject offset X0 from the optical axis, right positive.
    pub lateral_m: f32,
    /// Height H of the subject.
    pub height_m: f32,
}

/// Why there is no shadow angle.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the names describe these fields")]
pub enum Error {
    SunTooLow { elevation_deg: f32 },
    SunOverhead { elevation_deg: f32 },
    Senseless { what: &'static str, value_m: f32 },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::SunTooLow { elevation_deg } => write!(
                f,
                "the sun stands at {elevation_deg} deg: below {LEAST_ELEVATION_DEG} deg no shadow can be predicted"
            ),
            Self::SunOverhead { elevation_deg } => {
                write!(f, "the sun stands at {elevation_deg} deg, overhead: the shadow has no direction")
            }
            Self::Senseless { what, value_m } => {
                write!(f, "the {what} is {value_m} m, it must be a positive, finite length")
            }
        }
    }
}

impl core::error::Error for Error {}

/// Shadow in the image.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Shadow {
    /// Angle from the horizontal, -90 to 90, after mirroring; positive = below.
    pub eta_deg: f32,
    /// Rotation of the silhouette, 90 to 180.
    pub beta_deg: f32,
    /// The shadow points left, so the silhouette is mirrored first.
    pub mirrored: bool,
    /// Length of the shadow on the ground.
    pub length_m: f32,
    /// Distance of the shadow's end from the camera's plane; not positive next to or behind the camera.
    pub end_distance_m: f32,
    right_m: f32,
    forward_m: f32,
}

impl Shadow {
    /// The shadow of a subject. Fails with [`Error::SunTooLow`], [`Error::SunOverhead`] or [`Error::Senseless`].
    pub fn of(sun: &Sun, geometry: &Geometry) -> Result<Self, Error> {
        for (what, value_m) in [
            ("camera height", geometry.camera_height_m),
            ("distance of the subject", geometry.distance_m),
            ("height of the subject", geometry.height_m),
        ] {
            if !(value_m > 0.0 && value_m < f32::INFINITY) {
                return Err(Error::Senseless { what, value_m });
            }
        }
        if !geometry.lateral_m.is_finite() {
            return Err(Error::Senseless { what: "offset of the subject", value_m: geometry.lateral_m });
        }
        let elevation_deg = sun.elevation_deg();
        if elevation_deg.is_nan() || elevation_deg < LEAST_ELEVATION_DEG {
            return Err(Error::SunTooLow { elevation_deg });
        }
        let level = length(sun.east, sun.north);
        if level < 1e-4 {
            return Err(Error::SunOverhead { elevation_deg });
        }
        let (sin_a, cos_a) = geometry.azimuth.sin_cos();
        let (east, north) = (-sun.east / level, -sun.north / level);
        let length_m = geometry.height_m * level / sun.up;
        let right_m = length_m * (east * cos_a + north * sin_a);
        let forward_m = length_m * (north * cos_a - east * sin_a);
        let end_distance_m = geometry.distance_m + forward_m;
        // Multiplied by u (u + ry) / v, which has the sign of the end's distance.
        let behind = end_distance_m < 0.0;
        let across = geometry.distance_m * right_m - geometry.lateral_m * forward_m;
        let down = -geometry.camera_height_m * forward_m;
        let (across, down) = if behind { (-across, -down) } else { (across, down) };
        let mirrored = across < 0.0;
        let eta_deg = atan2_degrees(down, if mirrored { -across } else { across });
        let beta_deg = 135.0 - eta_deg / 2.0;
        Ok(Self { eta_deg, beta_deg, mirrored, length_m, end_distance_m, right_m, forward_m })
    }

    /// The shadow at a moment (Unix time, UT) and place, as [`Self::of`].
    pub fn at(unix_seconds: i64, place: &Place, geometry: &Geometry) -> Result<Self, Error> {
        Self::of(&Sun::at(unix_seconds, place), geometry)
    }
}

const RADIAN: f32 = PI / 180.0;
