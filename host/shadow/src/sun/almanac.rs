//! The Astronomical Almanac's low-precision formulas (section C, about 0.01 deg from 1950 to 2050).

use super::angles::Equatorial;
use super::clock::{hours_of_day, seconds_since_j2000};
use chrono::{DateTime, Utc};

/// Coefficients in degrees and degrees per day since 2000-01-01 12:00 UT.
pub(super) fn equatorial(time: DateTime<Utc>) -> Equatorial {
    let n = seconds_since_j2000(time) / 86_400.0;
    let mean_longitude = 280.460 + 0.985_647_4 * n;
    let mean_anomaly = (357.528 + 0.985_600_3 * n).to_radians();
    let longitude =
        (mean_longitude + 1.915 * mean_anomaly.sin() + 0.020 * (2.0 * mean_anomaly).sin()).to_radians();
    let obliquity = (23.439 - 4.0e-7 * n).to_radians();
    let right_ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos());
    let sidereal_hours = 6.697_375 + 0.065_709_824_2 * n + hours_of_day(time);
    Equatorial {
        declination_rad: (obliquity.sin() * longitude.sin()).asin(),
        greenwich_hour_angle_rad: (15.0 * sidereal_hours).to_radians() - right_ascension,
    }
}
