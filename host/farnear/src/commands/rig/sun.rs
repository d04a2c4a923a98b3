//! `farnear rig sun`: the board's answer, and the same calculation on this computer.

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_protocol::message::{
    QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
};
use serde::Serialize;

use super::Target;
use crate::report::{self, Usage};

/// Ask the board where the sun is and how a person's shadow lies, and hold its answer beside this computer's.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig sun --port sim --lat 52.38 --lon -1.56 --time 2012-07-17T12:00:00Z --azimuth 135"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Latitude, north positive.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    lat: f64,
    /// Longitude, east positive.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    lon: f64,
    /// The moment, RFC 3339.
    #[arg(long, value_name = "RFC3339")]
    time: String,
    /// Camera azimuth, ANTICLOCKWISE from north: with it a shadow is asked for.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    azimuth: Option<f64>,
    /// Height of the lens above the ground.
    #[arg(long, value_name = "M", default_value_t = 1.5)]
    camera_height: f64,
    /// Distance of the person along the optical axis.
    #[arg(long, value_name = "M", default_value_t = 8.0)]
    distance: f64,
    /// Distance of the person from the optical axis, right positive.
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_negative_numbers = true)]
    lateral: f64,
    /// Height of the person.
    #[arg(long, value_name = "M", default_value_t = 1.75)]
    height: f64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    elevation_deg: f32,
    azimuth_deg: f32,
    host_elevation_deg: f32,
    host_azimuth_deg: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    shadow: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    beta_deg: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sigma_beta_deg: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mirrored: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    shadow_length_m: Option<f32>,
    /// Whether board and host agree bit for bit.
    same_bits: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let query = query(&arguments)?;
    let rig = arguments.target.connect(None)?;
    let board = rig.client.sun(&query)?;
    // The same calculation here, by the code that the board runs.
    let host = farnear_rig::sun_query::answer(&query);
    let same_bits = bits(&board) == bits(&host);
    let angle = match board.shadow {
        Some(ShadowAnswer::Angle { beta_deg, sigma_beta_deg, mirrored, length_m, .. }) => {
            Some((beta_deg, sigma_beta_deg, mirrored, length_m))
        }
        _ => None,
    };
    let figures = Figures {
        elevation_deg: board.elevation_deg,
        azimuth_deg: board.azimuth_deg,
        host_elevation_deg: host.elevation_deg,
        host_azimuth_deg: host.azimuth_deg,
        shadow: board.shadow.map(shadow_name),
        beta_deg: angle.map(|a| a.0),
        sigma_beta_deg: angle.map(|a| a.1),
        mirrored: angle.map(|a| a.2),
        shadow_length_m: angle.map(|a| a.3),
        same_bits,
    };
    report::print(&figures, arguments.json)?;
    if !same_bits {
        bail!("the board's answer differs from this computer's: {board:?} against {host:?}");
    }
    Ok(())
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

fn query(arguments: &Arguments) -> Result<SunQuery> {
    let time = chrono::DateTime::parse_from_rfc3339(&arguments.time).with_context(|| {
        Usage(format!("--time {:?} is no RFC 3339 time such as 2012-07-17T12:00:00Z", arguments.time))
    })?;
    let degrees = |name: &str, value: f64, limit: f64| {
        if value.abs() <= limit {
            return Ok((value * 1e7).round() as i32);
        }
        bail!(Usage(format!("--{name} {value}: expected -{limit} to {limit} degrees")))
    };
    let millimetres = |name: &str, metres: f64| {
        let mm = (metres * 1e3).round();
        if mm.abs() <= 1e8 {
            return Ok(mm as i32);
        }
        bail!(Usage(format!("--{name} {metres} m makes no sense")))
    };
    let length = |name: &str, metres: f64| {
        u32::try_from(millimetres(name, metres)?)
            .with_context(|| Usage(format!("--{name} {metres} m must not be negative")))
    };
    let shadow = arguments.azimuth.map(|azimuth| -> Result<ShadowQuery> {
        Ok(ShadowQuery {
            azimuth_e7: degrees("azimuth", azimuth, 180.0)?,
            camera_height_mm: length("camera-height", arguments.camera_height)?,
            distance_mm: length("distance", arguments.distance)?,
            lateral_mm: millimetres("lateral", arguments.lateral)?,
            height_mm: length("height", arguments.height)?,
            deviations: USUAL,
        })
    });
    Ok(SunQuery {
        unix_seconds: time.timestamp(),
        latitude_e7: degrees("lat", arguments.lat, 90.0)?,
        longitude_e7: degrees("lon", arguments.lon, 180.0)?,
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
