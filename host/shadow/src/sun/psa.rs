//! PSA+ (Blanco, Milidonis, Bonanos: Updating the PSA sun position algorithm, Solar Energy 212, 2020).

use super::angles::Equatorial;
use super::clock::{hours_of_day, seconds_since_j2000};
use chrono::{DateTime, Utc};

/// `n` is days since 2000-01-01 12:00 UT; angles in radians.
pub(super) fn equatorial(time: DateTime<Utc>) -> Equatorial {
    let n = seconds_since_j2000(time) / 86_400.0;
    let node = 2.267_127_827 - 9.300_339_267e-4 * n;
    let mean_longitude = 4.895_036_035 + 1.720_279_602e-2 * n;
    let mean_anomaly = 6.239_468_336 + 1.720_200_135e-2 * n;
    let ecliptic_longitude = mean_longitude
        + 3.338_320_972e-2 * mean_anomaly.sin()
        + 3.497_596_876e-4 * (2.0 * mean_anomaly).sin()
        - 1.544_353_226e-4
        - 8.689_729_360e-6 * node.sin();
    let obliquity = 4.090_904_909e-1 - 6.213_605_399e-9 * n + 4.418_094_944e-5 * node.cos();
    let (sin_l, cos_l) = ecliptic_longitude.sin_cos();
    let right_ascension = (obliquity.cos() * sin_l).atan2(cos_l);
    let sidereal_hours = 6.697_096_103 + 6.570_984_737e-2 * n + hours_of_day(time);
    Equatorial {
        declination_rad: (obliquity.sin() * sin_l).asin(),
        greenwich_hour_angle_rad: (15.0 * sidereal_hours).to_radians() - right_ascension,
    }
}
