//! Li 2014, eq. 8.3 to 8.8, with corrected units, to reproduce the thesis: up to 1.13 deg of elevation and
//! 2.6 deg of azimuth off 55 values of SPA. UTC, longitude east, day 1 = 1 January. The printed formulas take the
//! standard meridian in radians per hour instead of 15 degrees per hour (8.7), swap latitude and longitude
//! near 8.3, and omit the equation of time's unit (minutes).

use super::angles::Equatorial;
use super::clock::hours_of_day;
use chrono::{DateTime, Datelike, Utc};
use std::f64::consts::TAU;

/// Declination (8.3) and Greenwich hour angle (8.4 to 8.8).
pub(super) fn equatorial(time: DateTime<Utc>) -> Equatorial {
    let year_angle = TAU / 365.0 * (f64::from(time.ordinal()) - 81.0);
    let declination_rad = (23.45_f64.to_radians().sin() * year_angle.sin()).asin();
    let equation_of_time_min =
        9.87 * (2.0 * year_angle).sin() - 7.53 * year_angle.cos() - 1.5 * year_angle.sin();
    let solar_hours = hours_of_day(time) + equation_of_time_min / 60.0;
    Equatorial { declination_rad, greenwich_hour_angle_rad: TAU / 24.0 * (solar_hours - 12.0) }
}
