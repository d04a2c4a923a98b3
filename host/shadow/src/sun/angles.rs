//! Equatorial and horizontal direction of the sun.

use serde::{Deserialize, Serialize};

/// Declination and Greenwich hour angle; the latter grows westwards without wrapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equatorial {
    pub declination_rad: f64,
    pub greenwich_hour_angle_rad: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SunPosition {
    pub elevation_deg: f64,
    /// Clockwise from north, 0 to 360.
    pub azimuth_deg: f64,
}

/// Converts declination, local hour angle and latitude (radians).
pub fn to_horizon(declination_rad: f64, hour_angle_rad: f64, latitude_rad: f64) -> SunPosition {
    let (sin_d, cos_d) = declination_rad.sin_cos();
    let (sin_h, cos_h) = hour_angle_rad.sin_cos();
    let (sin_l, cos_l) = latitude_rad.sin_cos();
    let up = sin_d * sin_l + cos_d * cos_l * cos_h;
    let east = -cos_d * sin_h;
    let north = sin_d * cos_l - cos_d * sin_l * cos_h;
    SunPosition {
        elevation_deg: up.atan2(east.hypot(north)).to_degrees(),
        azimuth_deg: east.atan2(north).to_degrees().rem_euclid(360.0),
    }
}
