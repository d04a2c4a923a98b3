//! Position of the sun.

use std::str::FromStr;

use chrono::{DateTime, Utc};
use farnear_maths::{angle::BinaryAngle, sun as board};
use farnear_shadow::sun::{self, Model, Place, SunError};
use serde::Serialize;

use crate::{error::Result, figures::rounded};

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
            let expected = "expected a date and a time with its zone, as 2026-06-21T12:00:00+02:00";
            crate::WorkflowError::parameter("time", time, expected)
        };
        let time = DateTime::parse_from_rfc3339(time).map_err(wrong)?.with_timezone(&Utc);
        Ok(Self { place, time })
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Formula {
    /// Host, double precision.
    Host(Model),
    /// Board code, single precision.
    Board,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0} (or board)")]
pub struct UnknownFormula(SunError);

impl FromStr for Formula {
    type Err = UnknownFormula;

    fn from_str(text: &str) -> Result<Self, UnknownFormula> {
        match text {
            "board" => Ok(Self::Board),
            other => other.parse().map(Self::Host).map_err(UnknownFormula),
        }
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
    let (elevation_deg, azimuth_deg) = match formula {
        Formula::Host(model) => {
            let sun = sun::position(moment.time, moment.place, model)?;
            (sun.elevation_deg, sun.azimuth_deg)
        }
        Formula::Board => {
            let sun = board::Sun::at(moment.time.timestamp(), &on_board(moment.place));
            (f64::from(sun.elevation_deg()), f64::from(sun.azimuth_deg()))
        }
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
    fn formulas_have_names() {
        assert_eq!("board".parse(), Ok(Formula::Board));
        assert_eq!("spa".parse(), Ok(Formula::Host(Model::Spa)));
        let error = "noaa".parse::<Formula>().expect_err("no formula");
        assert!(error.to_string().contains("`noaa`") && error.to_string().ends_with("(or board)"), "{error}");
    }

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
