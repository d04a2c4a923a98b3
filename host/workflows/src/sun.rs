//! Position of the sun.

use chrono::{DateTime, Utc};
use farnear_maths::{angle::BinaryAngle, sun as board};
use farnear_shadow::sun::{self, Model, Place};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    request::{PathKind, Request},
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    pub place: Place,
    pub time: DateTime<Utc>,
}

impl Moment {
    /// Time in RFC 3339, `2026-06-21T12:00:00+02:00`.
    pub fn new(latitude_deg: f64, longitude_deg: f64, time: &str) -> Result<Self> {
        let place = Place::new(latitude_deg, longitude_deg)?;
        let wrong = |_| {
            let expected =
                "expected a date and a time with its zone (RFC 3339), as 2026-06-21T12:00:00+02:00";
            WorkflowError::parameter("time", time, expected)
        };
        let time = DateTime::parse_from_rfc3339(time).map_err(wrong)?.with_timezone(&Utc);
        Ok(Self { place, time })
    }
}

/// Where and when the sun is looked for.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(default)]
pub struct PlaceAndTime {
    /// Latitude in degrees, north positive.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    pub lat: f64,
    /// Longitude in degrees, east positive.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    pub lon: f64,
    /// Time with its zone (RFC 3339), such as 2014-06-23T12:30:00+01:00.
    #[cfg_attr(feature = "clap", arg(long, value_name = "RFC3339"))]
    pub time: String,
}

impl PlaceAndTime {
    pub fn moment(&self) -> Result<Moment> {
        Moment::new(self.lat, self.lon, &self.time)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Formula {
    /// PSA+, within 0.01 deg of NREL's SPA from 1980 to 2050, 0.02 deg from 1900 to 2100.
    #[default]
    Psa,
    /// Two sines.
    Almanac,
    /// Li 2014, a degree off.
    Thesis,
    /// NREL's own.
    Spa,
    /// The rig's single-precision answer, bit for bit.
    Board,
}

/// Where the sun stands: elevation above the horizon and azimuth clockwise from north, without refraction.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear sun --lat 52.38 --lon -1.56 --time 2014-06-23T11:30:00Z --json")
)]
#[serde(default)]
pub struct SunPositionRequest {
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub at: PlaceAndTime,
    /// The formula.
    #[cfg_attr(feature = "clap", arg(long, value_enum, default_value = "psa"))]
    pub model: Formula,
}

impl Request for SunPositionRequest {
    const NAME: &'static str = "sun";
    const REQUIRED: &'static [&'static str] = &["lat", "lon", "time"];
    const PATHS: &'static [(&'static str, PathKind)] = &[];
    type Figures = SunFigures;

    fn check(&self) -> Result<()> {
        self.at.moment().map(drop)
    }

    fn run(&self, _: &Context<'_>) -> Result<SunFigures> {
        position(&self.at.moment()?, self.model)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SunFigures {
    pub elevation_deg: f64,
    /// Clockwise from north.
    pub azimuth_deg: f64,
}

/// Position of the sun without refraction, rounded to 1e-6 degrees.
pub fn position(moment: &Moment, formula: Formula) -> Result<SunFigures> {
    let model = match formula {
        Formula::Psa => Some(Model::Psa),
        Formula::Almanac => Some(Model::Almanac),
        Formula::Thesis => Some(Model::Thesis),
        Formula::Spa => Some(Model::Spa),
        Formula::Board => None,
    };
    let (elevation_deg, azimuth_deg) = if let Some(model) = model {
        let sun = sun::position(moment.time, moment.place, model)?;
        (sun.elevation_deg, sun.azimuth_deg)
    } else {
        let sun = board::Sun::at(moment.time.timestamp(), &on_board(moment.place));
        (f64::from(sun.elevation_deg()), f64::from(sun.azimuth_deg()))
    };
    Ok(SunFigures { elevation_deg: rounded(elevation_deg, 6), azimuth_deg: rounded(azimuth_deg, 6) })
}

fn on_board(place: Place) -> board::Place {
    let units = |degrees: f64| BinaryAngle::from_degrees_e7((degrees * 1e7).round() as i32);
    let east_deg =
        if place.longitude_deg > 180.0 { place.longitude_deg - 360.0 } else { place.longitude_deg };
    board::Place { latitude: units(place.latitude_deg), longitude: units(east_deg) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_board_counts_longitudes_above_180_degrees_as_west() {
        let time = sun::parse_time("2014-06-23T11:30:00Z").expect("a time");
        let at = |longitude_deg| {
            let moment = Moment { place: Place { latitude_deg: -54.8, longitude_deg }, time };
            position(&moment, Formula::Board).expect("the board refuses no time")
        };
        assert_eq!(at(291.7), at(-68.3));
    }
}
