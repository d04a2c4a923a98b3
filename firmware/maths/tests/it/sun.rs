//! The sun compared with f64 and with NREL's SPA.

use std::f64::consts::{PI, TAU};

use farnear_maths::angle::BinaryAngle;
use farnear_maths::sun::{Place, Sun};

pub const TOLERANCE_DEG: f64 = 0.01;

/// East, north, up by PSA+ (Blanco et al. 2020) in f64, time in days since 2000-01-01 12:00 UT.
pub fn sun_f64(days: f64, latitude: f64, longitude: f64) -> [f64; 3] {
    let n = days;
    let hours = 24.0 * (n + 0.5).rem_euclid(1.0);
    let node = 2.267127827 - 9.300339267e-4 * n;
    let mean = 4.895036035 + 1.720279602e-2 * n;
    let anomaly = 6.239468336 + 1.720200135e-2 * n;
    let l = mean + 3.338320972e-2 * anomaly.sin() + 3.497596876e-4 * (2.0 * anomaly).sin()
        - 1.544353226e-4
        - 8.689729360e-6 * node.sin();
    let e = 4.090904909e-1 - 6.213605399e-9 * n + 4.418094944e-5 * node.cos();
    let ascension = (e.cos() * l.sin()).atan2(l.cos());
    let declination = (e.sin() * l.sin()).asin();
    let sidereal = (6.697096103 + 6.570984737e-2 * n + hours) * PI / 12.0;
    let hour_angle = sidereal + longitude - ascension;
    let (sin_d, cos_d) = declination.sin_cos();
    let (sin_l, cos_l) = latitude.sin_cos();
    [
        -cos_d * hour_angle.sin(),
        sin_d * cos_l - cos_d * sin_l * hour_angle.cos(),
        sin_d * sin_l + cos_d * cos_l * hour_angle.cos(),
    ]
}

fn elevation_azimuth_deg([east, north, up]: [f64; 3]) -> (f64, f64) {
    let level = east.hypot(north);
    (up.atan2(level).to_degrees() - 0.00244 * level, east.atan2(north).to_degrees().rem_euclid(360.0))
}

pub fn days_since_epoch(unix_seconds: i64) -> f64 {
    (unix_seconds - 946_728_000) as f64 / 86_400.0
}

pub fn place(latitude_deg: f64, longitude_deg: f64) -> Place {
    let e7 = |degrees: f64| BinaryAngle::from_degrees_e7((degrees * 1e7).round() as i32);
    Place { latitude: e7(latitude_deg), longitude: e7(longitude_deg) }
}

fn turn_apart_deg(a: f64, b: f64) -> f64 {
    ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs()
}

/// Unix seconds of a date and time (Howard Hinnant's days_from_civil).
pub fn unix_seconds(year: i64, month: i64, day: i64, seconds: i64) -> i64 {
    let y = if month <= 2 { year - 1 } else { year };
    let era = y.div_euclid(400);
    let day_of_year = (153 * (month + if month > 2 { -3 } else { 9 }) + 2) / 5 + day - 1;
    let of_era = y.rem_euclid(400);
    let day_of_era = of_era * 365 + of_era / 4 - of_era / 100 + day_of_year;
    (era * 146_097 + day_of_era - 719_468) * 86_400 + seconds
}

#[test]
fn sine_and_cosine_hold_to_single_precision() {
    let mut largest = 0.0_f64;
    for i in 0..1_000_000_u32 {
        let angle = BinaryAngle::from_units(i.wrapping_mul(4_294_967));
        let exact = f64::from(angle.units()) / 4_294_967_296.0 * TAU;
        let (sin, cos) = angle.sin_cos();
        largest = largest.max((f64::from(sin) - exact.sin()).abs()).max((f64::from(cos) - exact.cos()).abs());
    }
    println!("{largest:.2e}");
    assert!(largest < 1.2e-7, "{largest}");
}

#[test]
fn angles_convert_both_ways() {
    for degrees in [-179.9_f32, -90.0, -1.5, 0.0, 0.001, 52.38, 90.0, 179.9] {
        assert!((BinaryAngle::from_degrees(degrees).to_degrees() - degrees).abs() < 2e-5, "{degrees}");
        let e7 = (f64::from(degrees) * 1e7).round() as i32;
        assert!((BinaryAngle::from_degrees_e7(e7).to_degrees() - degrees).abs() < 2e-5, "{degrees}");
    }
    assert_eq!(BinaryAngle::from_degrees_e7(900_000_000).units(), 1 << 30);
    assert_eq!(BinaryAngle::from_degrees_e7(-900_000_000).units(), 3 << 30);
    assert_eq!(BinaryAngle::from_degrees(f32::NAN).units(), 0);
}

#[test]
fn sun_agrees_with_f64_over_a_century_and_the_globe() {
    let (mut elevation_error, mut azimuth_error) = (0.0_f64, 0.0_f64);
    let mut time = unix_seconds(1980, 1, 1, 0);
    let end = unix_seconds(2080, 1, 1, 0);
    let mut i = 0_u32;
    while time < end {
        let latitude = f64::from(i * 37 % 179) - 89.0;
        let longitude = f64::from(i * 101 % 360) - 180.0 + 0.1234567;
        let sun = Sun::at(time, &place(latitude, longitude));
        let exact = sun_f64(days_since_epoch(time), latitude.to_radians(), longitude.to_radians());
        let (elevation, azimuth) = elevation_azimuth_deg(exact);
        elevation_error = elevation_error.max((f64::from(sun.elevation_deg()) - elevation).abs());
        // Near the zenith azimuth is ill-defined.
        if elevation.abs() < 89.0 {
            azimuth_error = azimuth_error.max(turn_apart_deg(f64::from(sun.azimuth_deg()), azimuth));
        }
        time += 40_009;
        i += 1;
    }
    println!("{i} places and times: elevation {elevation_error:.6} deg, azimuth {azimuth_error:.6} deg");
    assert!(elevation_error < TOLERANCE_DEG / 10.0, "{elevation_error}");
    assert!(azimuth_error < TOLERANCE_DEG / 5.0, "{azimuth_error}");
}

/// Example of NREL's SPA (Reda & Andreas, TP-560-34302, table A5.1): elevation without refraction 39.872046 deg,
/// azimuth 194.340241 deg.
#[test]
fn sun_agrees_with_the_example_of_spa() {
    let time = unix_seconds(2003, 10, 17, 19 * 3600 + 30 * 60 + 30);
    let sun = Sun::at(time, &place(39.742476, -105.1786));
    assert!((sun.elevation_deg() - 39.872046).abs() < 0.007, "{}", sun.elevation_deg());
    assert!((sun.azimuth_deg() - 194.34024).abs() < 0.05, "{}", sun.azimuth_deg());
}

#[test]
fn sun_agrees_with_the_values_of_spa() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/sun/spa_c_reference.csv");
    let Ok(text) = std::fs::read_to_string(file) else {
        println!("skipped: no shared data");
        return;
    };
    let (mut compared, mut elevation_error, mut azimuth_error) = (0, 0.0_f64, 0.0_f64);
    for line in text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        let fields: Vec<&str> = line.split(',').collect();
        let date: Vec<i64> =
            fields[0].split(['-', 'T', ':', 'Z']).filter_map(|field| field.parse().ok()).collect();
        let numbers: Vec<f64> = fields[1..].iter().map(|field| field.parse().unwrap()).collect();
        let [latitude, longitude, azimuth, zenith] = numbers[..] else { panic!("{line}") };
        let sun = Sun::at(
            unix_seconds(date[0], date[1], date[2], date[3] * 3600 + date[4] * 60 + date[5]),
            &place(latitude, longitude),
        );
        // Removes SPA's refraction at 1000 mbar and 10 C; it has none below the horizon.
        let apparent = 90.0 - zenith;
        if apparent < 1.0 || zenith < 1.0 {
            continue;
        }
        let refracted = |e: f64| {
            e + 1000.0 / 1010.0 * 283.0 / 283.0 * 1.02 / (60.0 * (e + 10.3 / (e + 5.11)).to_radians().tan())
        };
        compared += 1;
        elevation_error = elevation_error.max((refracted(f64::from(sun.elevation_deg())) - apparent).abs());
        azimuth_error = azimuth_error.max(turn_apart_deg(f64::from(sun.azimuth_deg()), azimuth));
    }
    println!("{compared} values: elevation {elevation_error:.4} deg, azimuth {azimuth_error:.4} deg");
    assert!(compared > 50 && elevation_error < 0.01 && azimuth_error < 0.05);
}
