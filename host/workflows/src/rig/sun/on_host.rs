//! The board's calculation here, by the code that the board runs.

use farnear_maths::{
    angle::BinaryAngle,
    shadow::{Deviations, Error, Geometry, Reliability, Shadow},
    sun::{Place, Sun},
};
use farnear_protocol::message::{ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery};

/// Answers a query as the board does.
pub(super) fn answer(query: &SunQuery) -> SunAnswer {
    let place = Place {
        latitude: BinaryAngle::from_degrees_e7(query.latitude_e7),
        longitude: BinaryAngle::from_degrees_e7(query.longitude_e7),
    };
    let sun = Sun::at(query.unix_seconds, &place);
    let shadow = query.shadow.map(|asked| shadow_answer(query.unix_seconds, &place, &sun, &asked));
    SunAnswer { elevation_deg: sun.elevation_deg(), azimuth_deg: sun.azimuth_deg(), shadow }
}

fn shadow_answer(unix_seconds: i64, place: &Place, sun: &Sun, asked: &ShadowQuery) -> ShadowAnswer {
    let metres = |mm: u32| mm as f32 * 1e-3;
    let geometry = Geometry {
        azimuth: BinaryAngle::from_degrees_e7(asked.azimuth_e7),
        camera_height_m: metres(asked.camera_height_mm),
        distance_m: metres(asked.distance_mm),
        lateral_m: asked.lateral_mm as f32 * 1e-3,
        height_m: metres(asked.height_mm),
    };
    let given = asked.deviations;
    let deviations = Deviations {
        day: given.day_e3 as f32 * 1e-3,
        time_h: given.time_s as f32 * (1.0 / 3600.0),
        latitude_deg: given.latitude_e7 as f32 * 1e-7,
        longitude_deg: given.longitude_e7 as f32 * 1e-7,
        azimuth_deg: given.azimuth_e7 as f32 * 1e-7,
        camera_height_m: metres(given.camera_height_mm),
        height_m: metres(given.height_mm),
        distance_m: metres(given.distance_mm),
    };
    match Shadow::of(sun, &geometry) {
        Ok(shadow) => {
            let deviation = shadow.deviation(unix_seconds, place, &geometry, &deviations);
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
        Err(Error::SunTooLow { .. }) => ShadowAnswer::SunTooLow,
        Err(Error::SunOverhead { .. }) => ShadowAnswer::SunOverhead,
        Err(_) => ShadowAnswer::Senseless,
    }
}
