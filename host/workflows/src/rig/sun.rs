//! Sun and shadow calculated by the board and, for comparison, on the host.

use chrono::DateTime;
use farnear_protocol::message::{
    QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
    sun::PlaceAndTime,
};

/// Ask the board where the sun is and how a person's shadow lies, and compare its answer with this computer's.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig sun --port sim --lat 52.38 --lon -1.56 --time 2012-07-17T12:00:00Z --azimuth 135"
    )
)]
#[serde(default)]
pub struct SunRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub at: PlaceAndTime,
    /// Camera azimuth, ANTICLOCKWISE from north: with it the board computes a shadow.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    pub azimuth: Option<f64>,
    /// Height of the lens above the ground.
    #[cfg_attr(feature = "clap", arg(long, value_name = "M", default_value_t = Self::default().camera_height))]
    pub camera_height: f64,
    /// Distance of the person along the optical axis.
    #[cfg_attr(feature = "clap", arg(long, value_name = "M", default_value_t = Self::default().distance))]
    pub distance: f64,
    /// Distance of the person from the optical axis, right positive.
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "M", default_value_t = Self::default().lateral)
    )]
    pub lateral: f64,
    /// Height of the person.
    #[cfg_attr(feature = "clap", arg(long, value_name = "M", default_value_t = Self::default().height))]
    pub height: f64,
}

impl Default for SunRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            at: PlaceAndTime::default(),
            azimuth: None,
            camera_height: 1.5,
            distance: 8.0,
            lateral: 0.0,
            height: 1.75,
        }
    }
}

impl Request for SunRequest {
    const NAME: &'static str = "rig sun";
    const REQUIRED: &'static [&'static str] = &["lat", "lon", "time"];
    const PATHS: &'static [(&'static str, PathKind)] = &[];
    type Figures = BoardSunFigures;

    fn run(&self, context: &Context<'_>) -> Result<BoardSunFigures> {
        sun(self, context)
    }

    fn verdict(figures: &BoardSunFigures) -> Result<()> {
        figures.check()
    }
}

crate::request::rig_request!(SunRequest);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct BoardSunFigures {
    /// Above the horizon, without refraction; calculated by the board.
    pub elevation_deg: f32,
    /// Clockwise from north; calculated by the board.
    pub azimuth_deg: f32,
    pub host_elevation_deg: f32,
    pub host_azimuth_deg: f32,
    /// Reliability of the shadow's angle, or why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shadow: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beta_deg: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_beta_deg: Option<f32>,
    /// Whether the shadow is on the other side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirrored: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shadow_length_m: Option<f32>,
    pub same_bits: bool,
    #[serde(skip)]
    pub board: SunAnswer,
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

pub fn sun(settings: &SunRequest, context: &Context<'_>) -> Result<BoardSunFigures> {
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

fn query(settings: &SunRequest) -> Result<SunQuery> {
    let time = DateTime::parse_from_rfc3339(&settings.at.time).map_err(|_| {
        let expected = "expected an RFC 3339 time such as 2012-07-17T12:00:00Z";
        WorkflowError::parameter("time", format!("`{}`", settings.at.time), expected)
    })?;
    let shadow = settings.azimuth.map(|azimuth_deg| -> Result<ShadowQuery> {
        Ok(ShadowQuery {
            azimuth_e7: degrees_e7("azimuth", azimuth_deg, 180.0)?,
            camera_height_mm: length_mm("camera-height", settings.camera_height)?,
            distance_mm: length_mm("distance", settings.distance)?,
            lateral_mm: millimetres("lateral", settings.lateral)?,
            height_mm: length_mm("height", settings.height)?,
            deviations: USUAL,
        })
    });
    Ok(SunQuery {
        unix_seconds: time.timestamp(),
        latitude_e7: degrees_e7("lat", settings.at.lat, 90.0)?,
        longitude_e7: degrees_e7("lon", settings.at.lon, 180.0)?,
        shadow: shadow.transpose()?,
    })
}

/// Typical standard deviations: a clock set by hand, a map, a compass, a tape measure.
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

/// Converts to the wire unit, 1e-7 degrees.
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

/// Bits of an answer, so that even NaNs compare.
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

    fn settings(lat: f64) -> SunRequest {
        let at = PlaceAndTime { lat, lon: -1.56, time: "2012-07-17T12:00:00Z".into() };
        SunRequest { at, ..SunRequest::default() }
    }

    #[test]
    fn places_times_and_lengths_are_checked_before_the_board_is_asked() {
        let person = SunRequest { azimuth: Some(135.0), lateral: -0.5, ..settings(52.38) };
        let asked = query(&person).unwrap();
        assert_eq!((asked.latitude_e7, asked.longitude_e7), (523_800_000, -15_600_000));
        assert_eq!((asked.unix_seconds, query(&settings(0.0)).unwrap().shadow), (1_342_526_400, None));
        assert_eq!(asked.shadow.map(|shadow| shadow.lateral_mm), Some(-500));
        for (settings, name) in [
            (settings(91.0), "lat 91"),
            (settings(f64::NAN), "lat NaN"),
            (
                SunRequest {
                    at: PlaceAndTime { time: "noon".into(), ..PlaceAndTime::default() },
                    ..settings(0.0)
                },
                "time `noon`",
            ),
            (SunRequest { height: -1.0, ..person.clone() }, "height -1"),
            (SunRequest { lateral: 1e9, ..person }, "lateral 1000000000"),
        ] {
            let error = query(&settings).unwrap_err();
            assert!(error.is_usage() && error.to_string().starts_with(name), "{error}");
        }
    }
}
