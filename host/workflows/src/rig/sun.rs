//! The board's answer where the sun is and how a person's shadow lies, and the same calculation on this computer.

use chrono::{DateTime, Utc};
use farnear_protocol::message::{
    QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
};
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

#[derive(Clone, PartialEq, Debug)]
pub struct SunSettings {
    pub rig: RigAddress,
    /// Latitude in degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude in degrees, east positive.
    pub longitude_deg: f64,
    pub time: DateTime<Utc>,
    pub shadow: Option<Person>,
}

/// A person before the camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Person {
    /// Where the camera looks, ANTICLOCKWISE from north.
    pub camera_azimuth_deg: f64,
    /// Height of the lens above the ground.
    pub camera_height_m: f64,
    /// Distance of the person along the optical axis.
    pub distance_m: f64,
    /// Distance of the person from the optical axis, right positive.
    pub lateral_m: f64,
    /// Height of the person.
    pub height_m: f64,
}

/// Where the sun is and how the shadow lies.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct BoardSunFigures {
    /// Above the horizon, without refraction; the board's.
    pub elevation_deg: f32,
    /// Clockwise from north; the board's.
    pub azimuth_deg: f32,
    pub host_elevation_deg: f32,
    pub host_azimuth_deg: f32,
    /// Reliability of the shadow's angle, or why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shadow: Option<&'static str>,
    /// Angle of the shadow in the image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beta_deg: Option<f32>,
    /// Its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_beta_deg: Option<f32>,
    /// Whether the shadow lies to the other side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirrored: Option<bool>,
    /// Length of the shadow on the ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shadow_length_m: Option<f32>,
    /// Whether board and host agree bit for bit.
    pub same_bits: bool,
    #[serde(skip)]
    pub board: SunAnswer,
    /// What this computer makes of the same question.
    #[serde(skip)]
    pub host: SunAnswer,
}

impl BoardSunFigures {
    pub fn check(&self) -> Result<()> {
        match self.same_bits {
            true => Ok(()),
            false => Err(WorkflowError::Differs(format!("{:?} against {:?}", self.board, self.host))),
        }
    }
}

/// Asks the board, and calculates the same here.
pub fn sun(settings: &SunSettings, context: &Context<'_>) -> Result<BoardSunFigures> {
    let query = query(settings)?;
    let rig = Rig::connect(&settings.rig, None, context)?;
    let board = rig.client.sun(&query)?;
    let host = farnear_rig::sun_query::answer(&query);
    let angle = match board.shadow {
        Some(ShadowAnswer::Angle { beta_deg, sigma_beta_deg, mirrored, length_m, .. }) => {
            Some((beta_deg, sigma_beta_deg, mirrored, length_m))
        }
        _ => None,
    };
    Ok(BoardSunFigures {
        elevation_deg: board.elevation_deg,
        azimuth_deg: board.azimuth_deg,
        host_elevation_deg: host.elevation_deg,
        host_azimuth_deg: host.azimuth_deg,
        shadow: board.shadow.map(shadow_name),
        beta_deg: angle.map(|a| a.0),
        sigma_beta_deg: angle.map(|a| a.1),
        mirrored: angle.map(|a| a.2),
        shadow_length_m: angle.map(|a| a.3),
        same_bits: bits(&board) == bits(&host),
        board,
        host,
    })
}

fn shadow_name(shadow: ShadowAnswer) -> &'static str {
    match shadow {
        ShadowAnswer::Angle { reliability: ShadowReliability::FirstOrder, .. } => "good",
        ShadowAnswer::Angle { reliability: ShadowReliability::ShadowNearCamera, .. } => "near the camera",
        ShadowAnswer::Angle { reliability: ShadowReliability::EitherSide, .. } => "to either side",
        ShadowAnswer::SunTooLow => "the sun is too low",
        ShadowAnswer::SunOverhead => "the sun is overhead",
        ShadowAnswer::Senseless => "a length makes no sense",
    }
}

fn query(settings: &SunSettings) -> Result<SunQuery> {
    let shadow = settings.shadow.map(|person| -> Result<ShadowQuery> {
        Ok(ShadowQuery {
            azimuth_e7: degrees_e7("azimuth", person.camera_azimuth_deg, 180.0)?,
            camera_height_mm: length_mm("camera-height", person.camera_height_m)?,
            distance_mm: length_mm("distance", person.distance_m)?,
            lateral_mm: millimetres("lateral", person.lateral_m)?,
            height_mm: length_mm("height", person.height_m)?,
            deviations: USUAL,
        })
    });
    Ok(SunQuery {
        unix_seconds: settings.time.timestamp(),
        latitude_e7: degrees_e7("lat", settings.latitude_deg, 90.0)?,
        longitude_e7: degrees_e7("lon", settings.longitude_deg, 180.0)?,
        shadow: shadow.transpose()?,
    })
}

/// How well a careful person knows these: a clock set by hand, a map, a compass, a tape measure.
const USUAL: QueryDeviations = QueryDeviations {
    day_e3: 0,
    time_s: 30,
    latitude_e7: 1_000,
    longitude_e7: 1_000,
    azimuth_e7: 10_000_000,
    camera_height_mm: 10,
    height_mm: 30,
    distance_mm: 100,
};

/// An angle as the wire carries it, in 1e-7 degrees.
fn degrees_e7(name: &'static str, degrees: f64, limit: f64) -> Result<i32> {
    if degrees.abs() <= limit {
        return Ok((degrees * 1e7).round() as i32);
    }
    Err(WorkflowError::parameter(name, degrees, format!("expected -{limit} to {limit} degrees")))
}

fn millimetres(name: &'static str, metres: f64) -> Result<i32> {
    let mm = (metres * 1e3).round();
    if mm.abs() <= 1e8 {
        return Ok(mm as i32);
    }
    Err(WorkflowError::parameter(name, metres, "expected -100000 to 100000 m"))
}

fn length_mm(name: &'static str, metres: f64) -> Result<u32> {
    let negative = |_| WorkflowError::parameter(name, metres, "expected 0 to 100000 m");
    u32::try_from(millimetres(name, metres)?).map_err(negative)
}

/// An answer as bits, so that even two NaN are compared.
fn bits(answer: &SunAnswer) -> [u32; 7] {
    let shadow = match answer.shadow {
        None => [0; 5],
        Some(ShadowAnswer::Angle { beta_deg, sigma_beta_deg, mirrored, length_m, reliability }) => {
            let kind = 1 + reliability as u32 * 2 + u32::from(mirrored);
            [kind, beta_deg.to_bits(), sigma_beta_deg.to_bits(), length_m.to_bits(), 0]
        }
        Some(ShadowAnswer::SunTooLow) => [0, 0, 0, 0, 1],
        Some(ShadowAnswer::SunOverhead) => [0, 0, 0, 0, 2],
        Some(ShadowAnswer::Senseless) => [0, 0, 0, 0, 3],
    };
    let [a, b, c, d, e] = shadow;
    [answer.elevation_deg.to_bits(), answer.azimuth_deg.to_bits(), a, b, c, d, e]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(latitude_deg: f64, shadow: Option<Person>) -> SunSettings {
        let time = DateTime::from_timestamp(1_342_526_400, 0).unwrap();
        let rig = RigAddress::Port("none".into());
        SunSettings { rig, latitude_deg, longitude_deg: -1.56, time, shadow }
    }

    #[test]
    fn places_and_lengths_are_checked_before_the_board_is_asked() {
        let person = Person {
            camera_azimuth_deg: 135.0,
            camera_height_m: 1.5,
            distance_m: 8.0,
            lateral_m: -0.5,
            height_m: 1.75,
        };
        let asked = query(&settings(52.38, Some(person))).unwrap();
        assert_eq!((asked.latitude_e7, asked.longitude_e7), (523_800_000, -15_600_000));
        assert_eq!(asked.shadow.map(|shadow| shadow.lateral_mm), Some(-500));
        for (settings, name) in [
            (settings(91.0, None), "lat 91"),
            (settings(f64::NAN, None), "lat NaN"),
            (settings(0.0, Some(Person { height_m: -1.0, ..person })), "height -1"),
            (settings(0.0, Some(Person { lateral_m: 1e9, ..person })), "lateral 1000000000"),
        ] {
            let error = query(&settings).unwrap_err();
            assert!(error.is_usage() && error.to_string().starts_with(name), "{error}");
        }
    }
}
