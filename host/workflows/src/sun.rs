//! `farnear sun`: where the sun stands for a place and a time.

use anyhow::Result;
use chrono::{DateTime, Utc};
use clap::Args;
use farnear_activity::sun::{self, Model, Place};
use farnear_maths::{angle::BinaryAngle, sun as board};
use serde::Serialize;

use crate::report;

/// A place and a time, as the commands that need the sun ask for them.
#[derive(Args)]
pub struct Moment {
    /// Latitude in degrees, north positive.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = latitude)]
    pub lat: f64,
    /// Longitude in degrees, east positive.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = longitude)]
    pub lon: f64,
    /// Time with its zone (RFC 3339), such as 2014-06-23T12:30:00+01:00.
    #[arg(long, value_name = "RFC3339", value_parser = sun::parse_time)]
    pub time: DateTime<Utc>,
}

impl Moment {
    /// The place.
    pub fn place(&self) -> Place {
        Place { latitude_deg: self.lat, longitude_deg: self.lon }
    }
}

/// Where the sun stands: elevation above the horizon and azimuth clockwise from north, without refraction.
#[derive(Args)]
#[command(after_help = "Example: farnear sun --lat 52.38 --lon -1.56 --time 2014-06-23T11:30:00Z --json")]
pub struct Arguments {
    #[command(flatten)]
    moment: Moment,
    /// psa (PSA+, within 0.01 deg of NREL's SPA), almanac (two sines), thesis (Li 2014, a degree off), spa (NREL's own), or
    /// board (the rig's single-precision answer, bit for bit).
    #[arg(long, default_value = "psa", value_parser = Formula::parse)]
    model: Formula,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Who computes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Formula {
    /// The host, in double precision.
    Host(Model),
    /// The code that runs on the board.
    Board,
}

impl Formula {
    fn parse(text: &str) -> Result<Self, String> {
        match text {
            "board" => Ok(Self::Board),
            other => other.parse().map(Self::Host).map_err(|error| format!("{error} (or board)")),
        }
    }
}

#[derive(Serialize)]
struct Figures {
    elevation_deg: f64,
    azimuth_deg: f64,
}

/// Runs the command.
///
/// # Errors
/// Where SPA refuses the time.
pub fn run(arguments: &Arguments) -> Result<()> {
    let Moment { lat, lon, time } = arguments.moment;
    let figures = match arguments.model {
        Formula::Host(model) => {
            let sun = sun::position(time, arguments.moment.place(), model)?;
            Figures { elevation_deg: sun.elevation_deg, azimuth_deg: sun.azimuth_deg }
        }
        Formula::Board => {
            let units = |degrees: f64| BinaryAngle::from_degrees_e7((degrees * 1e7).round() as i32);
            let east_deg = if lon > 180.0 { lon - 360.0 } else { lon };
            let place = board::Place { latitude: units(lat), longitude: units(east_deg) };
            let sun = board::Sun::at(time.timestamp(), &place);
            Figures {
                elevation_deg: f64::from(sun.elevation_deg()),
                azimuth_deg: f64::from(sun.azimuth_deg()),
            }
        }
    };
    let figures = Figures {
        elevation_deg: report::rounded(figures.elevation_deg, 6),
        azimuth_deg: report::rounded(figures.azimuth_deg, 6),
    };
    report::print(&figures, arguments.json)
}

fn latitude(text: &str) -> Result<f64, String> {
    let degrees = number(text)?;
    Place::new(degrees, 0.0).map(|place| place.latitude_deg).map_err(|error| error.to_string())
}

fn longitude(text: &str) -> Result<f64, String> {
    let degrees = number(text)?;
    Place::new(0.0, degrees).map(|place| place.longitude_deg).map_err(|error| error.to_string())
}

fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("`{text}` is no number of degrees"))
}
