//! Where the sun is and how a subject's shadow lies: the message's integers into `farnear_maths`, its answer back.
//!
//! Cost: 550 instructions for the sun, 250 for its angles, 400 for the shadow, 1,400 for its deviation.

use farnear_maths::angle::BinaryAngle;
use farnear_maths::shadow::{Deviations, Error, Geometry, Reliability, Shadow};
use farnear_maths::sun::{Place, Sun};
use farnear_protocol::message::{
    QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
};

/// Answers a query.
pub(crate) fn answer(query: &SunQuery) -> SunAnswer {
    let place = Place {
        latitude: BinaryAngle::from_degrees_e7(query.latitude_e7),
        longitude: BinaryAngle::from_degrees_e7(query.longitude_e7),
    };
    let sun = Sun::at(query.unix_seconds, &place);
    SunAnswer {
        elevation_deg: sun.elevation_deg(),
        azimuth_deg: sun.azimuth_deg(),
        shadow: query.shadow.map(|shadow| shadow_answer(&sun, query.unix_seconds, &place, &shadow)),
    }
}

fn shadow_answer(sun: &Sun, unix_seconds: i64, place: &Place, query: &ShadowQuery) -> ShadowAnswer {
    let geometry = Geometry {
        azimuth: BinaryAngle::from_degrees_e7(query.azimuth_e7),
        camera_height_m: metres(query.camera_height_mm),
        distance_m: metres(query.distance_mm),
        lateral_m: query.lateral_mm as f32 * 1e-3,
        height_m: metres(query.height_mm),
    };
    let shadow = match Shadow::of(sun, &geometry) {
        Ok(shadow) => shadow,
        Err(Error::SunTooLow { .. }) => return ShadowAnswer::SunTooLow,
        Err(Error::SunOverhead { .. }) => return ShadowAnswer::SunOverhead,
        Err(_) => return ShadowAnswer::Senseless,
    };
    let deviation = shadow.deviation(unix_seconds, place, &geometry, &deviations(&query.deviations));
    ShadowAnswer::Angle {
        beta_deg: shadow.beta_deg,
        sigma_beta_deg: deviation.beta_deg,
        mirrored: shadow.mirrored,
        length_m: shadow.length_m,
        reliability: match deviation.reliability {
            Reliability::FirstOrder => ShadowReliability::FirstOrder,
            Reliability::ShadowNearCamera => ShadowReliability::ShadowNearCamera,
            Reliability::EitherSide => ShadowReliability::EitherSide,
        },
    }
}

fn deviations(given: &QueryDeviations) -> Deviations {
    Deviations {
        day: given.day_e3 as f32 * 1e-3,
        time_h: given.time_s as f32 * (1.0 / 3600.0),
        latitude_deg: given.latitude_e7 as f32 * 1e-7,
        longitude_deg: given.longitude_e7 as f32 * 1e-7,
        azimuth_deg: given.azimuth_e7 as f32 * 1e-7,
        camera_height_m: metres(given.camera_height_mm),
        height_m: metres(given.height_mm),
        distance_m: metres(given.distance_mm),
    }
}

fn metres(mm: u32) -> f32 {
    mm as f32 * 1e-3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_morning_in_coventry_casts_a_shadow() {
        // 2014-06-21 09:00 UT at 52.4 N, 1.5 W: hour angle -47 deg, declination 23.4 deg, and the triangle by hand.
        let none = QueryDeviations {
            day_e3: 0,
            time_s: 60,
            latitude_e7: 1_000,
            longitude_e7: 1_000,
            azimuth_e7: 10_000_000,
            camera_height_mm: 20,
            height_mm: 50,
            distance_mm: 100,
        };
        let shadow = ShadowQuery {
            azimuth_e7: 0,
            camera_height_mm: 1_500,
            distance_mm: 8_000,
            lateral_mm: 0,
            height_mm: 1_750,
            deviations: none,
        };
        let query = SunQuery {
            unix_seconds: 1_403_341_200,
            latitude_e7: 524_000_000,
            longitude_e7: -15_000_000,
            shadow: Some(shadow),
        };
        let sun = answer(&query);
        assert!((sun.elevation_deg - 44.2).abs() < 0.3, "{sun:?}");
        assert!((sun.azimuth_deg - 110.7).abs() < 0.5, "{sun:?}");
        let Some(ShadowAnswer::Angle { mirrored, length_m, sigma_beta_deg, .. }) = sun.shadow else {
            panic!("{sun:?}")
        };
        assert!(mirrored, "the sun is on the right, the shadow falls to the left");
        assert!((length_m - 1.80).abs() < 0.02 && (0.1..5.0).contains(&sigma_beta_deg), "{sun:?}");
        let night = SunQuery { unix_seconds: 1_403_308_800, ..query };
        assert_eq!(answer(&night).shadow, Some(ShadowAnswer::SunTooLow));
        let flat = ShadowQuery { height_mm: 0, ..shadow };
        assert_eq!(answer(&SunQuery { shadow: Some(flat), ..query }).shadow, Some(ShadowAnswer::Senseless));
    }
}
