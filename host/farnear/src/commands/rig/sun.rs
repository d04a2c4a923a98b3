//! `farnear rig sun`: the board's answer, and the same calculation on this computer.

use anyhow::{Context, Result};
use chrono::DateTime;
use clap::Args;
use farnear_workflows::rig::sun::{self, Person, SunSettings};

use super::Target;
use crate::{
    report::{self, Usage},
    terminal,
};

/// Ask the board for the sun's position and a person's shadow, and compare the answer with this computer's.
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
    /// Camera azimuth, ANTICLOCKWISE from north; needed for a shadow.
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

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let time = DateTime::parse_from_rfc3339(&arguments.time).with_context(|| {
        let time = &arguments.time;
        Usage(format!("--time {time:?} is not an RFC 3339 time such as 2012-07-17T12:00:00Z"))
    })?;
    let shadow = arguments.azimuth.map(|camera_azimuth_deg| Person {
        camera_azimuth_deg,
        camera_height_m: arguments.camera_height,
        distance_m: arguments.distance,
        lateral_m: arguments.lateral,
        height_m: arguments.height,
    });
    let settings = SunSettings {
        rig: arguments.target.address()?,
        latitude_deg: arguments.lat,
        longitude_deg: arguments.lon,
        time: time.to_utc(),
        shadow,
    };
    let figures = sun::sun(&settings, &terminal::context()?)?;
    report::print(&figures, arguments.json)?;
    Ok(figures.check()?)
}
