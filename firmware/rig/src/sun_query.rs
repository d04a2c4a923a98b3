//! Sun and shadow: the message's integers for `farnear_maths` and back. The host calls it too, to compare bit by bit
//! (`docs/decisions/0009-sun-query.md`). Instructions: sun with its angles 725, shadow 160, its deviation 990.

use farnear_maths::angle::BinaryAngle;
use farnear_maths::shadow::{Deviations, Error, Geometry, Reliability, Shadow};
use farnear_maths::sun::{Place, Sun};
use farnear_protocol::message::{
    QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
};

/// Angles in degrees without refraction, as in [`SunAnswer`]; the same bits on every processor.
pub fn answer(query: &SunQuery) -> SunAnswer {
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

    const EXACT: QueryDeviations = QueryDeviations {
        day_e3: 0,
        time_s: 0,
        latitude_e7: 0,
        longitude_e7: 0,
        azimuth_e7: 0,
        camera_height_mm: 0,
        height_mm: 0,
        distance_mm: 0,
    };

    /// 2014-06-21 09:00 UT at 52.4 N, 1.5 W; a person 0.6 m left of the axis, camera 20 deg west of north.
    const QUERY: SunQuery = SunQuery {
        unix_seconds: 1_403_341_200,
        latitude_e7: 524_000_000,
        longitude_e7: -15_000_000,
        shadow: Some(SHADOW),
    };
    const SHADOW: ShadowQuery = ShadowQuery {
        azimuth_e7: 200_000_000,
        camera_height_mm: 1_500,
        distance_mm: 8_000,
        lateral_mm: -600,
        height_mm: 1_750,
        deviations: EXACT,
    };

    /// Standard deviation of the shadow's angle for these input deviations.
    fn sigma_deg(deviations: QueryDeviations) -> f32 {
        let query = SunQuery { shadow: Some(ShadowQuery { deviations, ..SHADOW }), ..QUERY };
        match answer(&query).shadow {
            Some(ShadowAnswer::Angle { sigma_beta_deg, .. }) => sigma_beta_deg,
            other => panic!("{other:?}"),
        }
    }

    /// Reference values: the Astronomical Almanac's low-precision sun (0.01 deg), a pinhole camera in f64.
    #[test]
    fn a_query_gives_what_an_independent_calculation_gives() {
        let sun = answer(&QUERY);
        assert!((sun.elevation_deg - 44.2155).abs() < 0.02, "{sun:?}");
        assert!((sun.azimuth_deg - 110.7275).abs() < 0.05, "{sun:?}");
        let Some(ShadowAnswer::Angle { beta_deg, mirrored, length_m, reliability, .. }) = sun.shadow else {
            panic!("{sun:?}")
        };
        // 0.02 deg of the sun's direction rotate the shadow's image by no more than that.
        assert!((beta_deg - 139.8957).abs() < 0.03, "{sun:?}");
        assert!((length_m - 1.7986).abs() < 0.002, "{sun:?}");
        assert!(mirrored, "the sun is on the right, the shadow falls to the left");
        assert_eq!(reliability, ShadowReliability::FirstOrder);
    }

    /// Each standard deviation alone, compared with central differences.
    #[test]
    fn each_deviation_has_its_unit_and_its_weight() {
        for (name, deviations, expected) in [
            ("two days", QueryDeviations { day_e3: 2_000, ..EXACT }, 0.019_93),
            ("ten minutes", QueryDeviations { time_s: 600, ..EXACT }, 0.453_93),
            ("half a degree of latitude", QueryDeviations { latitude_e7: 5_000_000, ..EXACT }, 0.082_43),
            ("a quarter of longitude", QueryDeviations { longitude_e7: 2_500_000, ..EXACT }, 0.045_40),
            ("two degrees of azimuth", QueryDeviations { azimuth_e7: 20_000_000, ..EXACT }, 0.362_33),
            ("50 mm of camera height", QueryDeviations { camera_height_mm: 50, ..EXACT }, 0.160_03),
            ("0.3 m of distance", QueryDeviations { distance_mm: 300, ..EXACT }, 0.180_04),
        ] {
            let sigma = sigma_deg(deviations);
            // The deviation is accurate to 1 %; near the solstice the day's slope is small and less accurate.
            let tolerance = if deviations.day_e3 > 0 { 0.03 } else { 0.01 };
            assert!((sigma / expected - 1.0).abs() < tolerance, "{name}: {sigma} instead of {expected}");
        }
        let tall = sigma_deg(QueryDeviations { height_mm: 70, ..EXACT });
        assert!(tall < 1e-6, "a taller person has a longer shadow in the same direction: {tall}");
    }

    #[test]
    fn a_missing_angle_has_a_reason() {
        let night = SunQuery { unix_seconds: 1_403_308_800, ..QUERY };
        assert_eq!(answer(&night).shadow, Some(ShadowAnswer::SunTooLow));
        let flat = ShadowQuery { height_mm: 0, ..SHADOW };
        assert_eq!(answer(&SunQuery { shadow: Some(flat), ..QUERY }).shadow, Some(ShadowAnswer::Senseless));
        assert_eq!(answer(&SunQuery { shadow: None, ..QUERY }).shadow, None);
        // Latitude and longitude below the sun, by PSA+ in double precision.
        let below = SunQuery { latitude_e7: 234_350_267, longitude_e7: 454_370_291, ..QUERY };
        assert_eq!(answer(&below).shadow, Some(ShadowAnswer::SunOverhead));
    }

    #[test]
    fn a_shadow_towards_or_away_from_the_camera_has_an_unreliable_deviation() {
        let deviations = QueryDeviations { azimuth_e7: 20_000_000, ..EXACT };
        // The sun is 110.7 deg east of north; the camera looks against it or along its light.
        for (azimuth_e7, distance_mm, expected) in [
            (200_000_000, 8_000, ShadowReliability::FirstOrder),
            (692_725_000, 8_000, ShadowReliability::EitherSide),
            (-1_107_275_000, 1_700, ShadowReliability::ShadowNearCamera),
        ] {
            let shadow = ShadowQuery { azimuth_e7, distance_mm, lateral_mm: 0, deviations, ..SHADOW };
            let found = answer(&SunQuery { shadow: Some(shadow), ..QUERY }).shadow;
            let Some(ShadowAnswer::Angle { reliability, .. }) = found else { panic!("{found:?}") };
            assert_eq!(reliability, expected, "{found:?}");
        }
    }
}
