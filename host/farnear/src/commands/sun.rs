use anyhow::Result;
use chrono::{DateTime, Utc};
use clap::Args;
use farnear_shadow::sun::{self, Place};
use farnear_workflows::sun::{Formula, Moment, position};

use crate::report;

/// A place and a time, as the commands that need the sun ask for them.
#[derive(Args)]
pub struct MomentArguments {
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

impl MomentArguments {
    pub fn moment(&self) -> Moment {
        Moment { place: Place { latitude_deg: self.lat, longitude_deg: self.lon }, time: self.time }
    }
}

/// Where the sun stands: elevation above the horizon and azimuth clockwise from north, without refraction.
#[derive(Args)]
#[command(after_help = "Example: farnear sun --lat 52.38 --lon -1.56 --time 2014-06-23T11:30:00Z --json")]
pub struct Arguments {
    #[command(flatten)]
    moment: MomentArguments,
    /// psa (PSA+, within 0.01 deg of NREL's SPA), almanac (two sines), thesis (Li 2014, a degree off), spa (NREL's own), or
    /// board (the rig's single-precision answer, bit for bit).
    #[arg(long, default_value = "psa")]
    model: Formula,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    report::print(&position(&arguments.moment.moment(), arguments.model)?, arguments.json)
}

pub fn latitude(text: &str) -> Result<f64, String> {
    let degrees = number(text)?;
    Place::new(degrees, 0.0).map(|place| place.latitude_deg).map_err(|error| error.to_string())
}

pub fn longitude(text: &str) -> Result<f64, String> {
    let degrees = number(text)?;
    Place::new(0.0, degrees).map(|place| place.longitude_deg).map_err(|error| error.to_string())
}

fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("`{text}` is not a number of degrees"))
}
