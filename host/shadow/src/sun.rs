//! Sun position for a place and time: topocentric elevation and azimuth without refraction.
//!
//! Closed forms give declination and Greenwich hour angle ([`Equatorial`]); one vector form converts them
//! without branch or division, safe at noon, pole and zenith: `U = sin d sin L + cos d cos L cos h`, `E =
//! -cos d sin h`, `N = sin d cos L - cos d sin L cos h`, elevation `atan2(U, hypot(E, N))`, azimuth `atan2(E,
//! N)` clockwise from north.
//!
//! Largest differences from 55 values of NREL's SPA, sun up, 1910 to 2210: PSA+ 0.0097 deg elevation and 0.047 deg
//! azimuth; Almanac 0.0123 and 0.020; thesis 1.13 and 2.6. Over the whole globe, 1900 to 2100, PSA+ is off by up to
//! 0.02 deg on the sky.

mod almanac;
mod angles;
mod clock;
mod place;
mod psa;
mod spa;
mod thesis;

pub use angles::{Equatorial, SunPosition, to_horizon};
pub use clock::parse_time;
pub use place::{Place, SunError};

use chrono::{DateTime, Utc};
use serde::{
    Deserialize, Serialize,
    de::{IntoDeserializer, value},
};
use std::str::FromStr;

/// Parallax of the sun, degrees times cos(elevation) (8.794 arc seconds).
const PARALLAX_DEG: f64 = 8.794 / 3600.0;

/// Formula for declination and hour angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// PSA+ (Blanco et al. 2020, doi:10.1016/j.solener.2020.10.084): the default.
    #[default]
    Psa,
    /// The Astronomical Almanac's low-precision form with two sines.
    Almanac,
    /// Li 2014, eq. 8.2 to 8.10 with corrected units, for comparison.
    Thesis,
    /// NREL's Solar Position Algorithm (Reda and Andreas 2004), the reference.
    Spa,
}

impl FromStr for Model {
    type Err = value::Error;

    fn from_str(text: &str) -> Result<Self, value::Error> {
        Self::deserialize(text.into_deserializer())
    }
}

/// Elevation and azimuth; neglects UT1 - UTC (0.004 deg). Fails for an invalid place or a time outside SPA.
pub fn position(time: DateTime<Utc>, place: Place, model: Model) -> Result<SunPosition, SunError> {
    let place = Place::new(place.latitude_deg, place.longitude_deg)?;
    if model == Model::Spa {
        return spa::position(time, place);
    }
    let sun = equatorial(time, model);
    let hour_angle = sun.greenwich_hour_angle_rad + place.longitude_deg.to_radians();
    let geocentric = to_horizon(sun.declination_rad, hour_angle, place.latitude_deg.to_radians());
    let parallax = if model == Model::Thesis { 0.0 } else { PARALLAX_DEG };
    Ok(SunPosition {
        elevation_deg: geocentric.elevation_deg - parallax * geocentric.elevation_deg.to_radians().cos(),
        ..geocentric
    })
}

/// Declination and Greenwich hour angle; for SPA those of PSA+ (within 0.01 deg), for derivatives only.
pub fn equatorial(time: DateTime<Utc>, model: Model) -> Equatorial {
    match model {
        Model::Psa | Model::Spa => psa::equatorial(time),
        Model::Almanac => almanac::equatorial(time),
        Model::Thesis => thesis::equatorial(time),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equinox_noon_on_the_equator_is_near_the_zenith() {
        let at = parse_time("2014-03-20T12:07:00Z").expect("a time");
        for model in [Model::Psa, Model::Almanac, Model::Spa] {
            let sun =
                position(at, Place { latitude_deg: 0.0, longitude_deg: 0.0 }, model).expect("a position");
            assert!(sun.elevation_deg > 89.6, "{model:?}: {sun:?}");
        }
    }

    #[test]
    fn morning_sun_is_east_and_afternoon_sun_west_in_both_hemispheres() {
        for latitude_deg in [52.0, -34.0] {
            let place = Place { latitude_deg, longitude_deg: 0.0 };
            let morning =
                position(parse_time("2014-10-01T08:00:00Z").expect("time"), place, Model::Psa).expect("sun");
            let evening =
                position(parse_time("2014-10-01T16:00:00Z").expect("time"), place, Model::Psa).expect("sun");
            assert!((20.0..170.0).contains(&morning.azimuth_deg), "{morning:?}");
            assert!((190.0..340.0).contains(&evening.azimuth_deg), "{evening:?}");
        }
    }

    #[test]
    fn bad_input_is_named() {
        assert_eq!(Place::new(95.0, 0.0), Err(SunError::Latitude(95.0)));
        assert!(matches!(Place::new(f64::NAN, 0.0), Err(SunError::Latitude(_))));
        assert!(parse_time("yesterday").expect_err("no time").to_string().contains("RFC 3339"));
    }
}
