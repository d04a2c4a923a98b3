//! The shadow's angle compared with f64, its standard deviation with Monte Carlo.

use std::f64::consts::{PI, TAU};

use farnear_maths::angle::BinaryAngle;
use farnear_maths::shadow::{Deviation, Deviations, Error, Geometry, Reliability, Shadow};
use farnear_maths::sun::{Place, Sun};
use proptest::prelude::*;

use crate::sun::{TOLERANCE_DEG, days_since_epoch, place, sun_f64, unix_seconds};

struct Case {
    name: &'static str,
    day: i64,
    hour: f64,
    latitude_deg: f64,
    longitude_deg: f64,
    azimuth_deg: f64,
    distance_m: f64,
    camera_height_m: f64,
}

const HEIGHT_M: f64 = 1.75;
const HEAD_M: f64 = 0.17;
const IMAGE_M: f64 = 4e-3;
const HALF_PIXEL_M: f64 = 3e-6;

const CASES: [Case; 5] = [
    Case {
        name: "S1",
        day: 174,
        hour: 10.5,
        latitude_deg: 52.38,
        longitude_deg: -1.56,
        azimuth_deg: 140.0,
        distance_m: 5.0,
        camera_height_m: 0.8,
    },
    Case {
        name: "S2",
        day: 174,
        hour: 15.0,
        latitude_deg: 52.38,
        longitude_deg: -1.56,
        azimuth_deg: 60.0,
        distance_m: 5.0,
        camera_height_m: 1.5,
    },
    Case {
        name: "S3",
        day: 350,
        hour: 12.0,
        latitude_deg: 52.38,
        longitude_deg: -1.56,
        azimuth_deg: 170.0,
        distance_m: 8.0,
        camera_height_m: 2.5,
    },
    Case {
        name: "S4",
        day: 81,
        hour: 9.0,
        latitude_deg: 1.0,
        longitude_deg: 0.0,
        azimuth_deg: 0.0,
        distance_m: 6.0,
        camera_height_m: 2.0,
    },
    Case {
        name: "S5",
        day: 1,
        hour: 10.0,
        latitude_deg: -33.9,
        longitude_deg: 20.0,
        azimuth_deg: 200.0,
        distance_m: 10.0,
        camera_height_m: 3.0,
    },
];

impl Case {
    fn time(&self) -> i64 {
        unix_seconds(2023, 1, 1, 0) + (self.day - 1) * 86_400 + (self.hour * 3600.0) as i64
    }

    fn place(&self) -> Place {
        place(self.latitude_deg, self.longitude_deg)
    }

    fn geometry(&self) -> Geometry {
        Geometry {
            azimuth: BinaryAngle::from_degrees(self.azimuth_deg as f32),
            camera_height_m: self.camera_height_m as f32,
            distance_m: self.distance_m as f32,
            lateral_m: 0.0,
            height_m: HEIGHT_M as f32,
        }
    }

    fn deviations(&self) -> Deviations {
        let head_image_m = HEAD_M * IMAGE_M / self.distance_m;
        Deviations {
            day: 0.3,
            time_h: 0.05,
            latitude_deg: 0.05,
            longitude_deg: 0.05,
            azimuth_deg: 2.0,
            camera_height_m: 0.05,
            height_m: 0.07,
            distance_m: Deviations::of_distance(
                (HEAD_M as f32, 0.012),
                (IMAGE_M as f32, 20e-6),
                (head_image_m as f32, HALF_PIXEL_M as f32),
            ),
        }
    }

    fn deviation(&self) -> Deviation {
        let (time, place, geometry) = (self.time(), self.place(), self.geometry());
        let shadow = Shadow::at(time, &place, &geometry).unwrap();
        shadow.deviation(time, &place, &geometry, &self.deviations())
    }

    /// beta in degrees by projection in f64; each of `e` scales a standard deviation.
    fn beta_deg(&self, e: &[f64; 10]) -> f64 {
        let days = days_since_epoch(self.time()) + 0.3 * e[0].round_to(1.0 / 86_400.0) + 0.05 / 24.0 * e[1];
        // The day's error keeps the time of day: PSA+ uses one number for both, so the place is rotated back.
        let turned_back = TAU * 0.3 * e[0].round_to(1.0 / 86_400.0);
        let latitude = (self.latitude_deg + 0.05 * e[2]).to_radians();
        let longitude = (self.longitude_deg + 0.05 * e[3]).to_radians() - turned_back;
        let [east, north, up] = sun_f64(days, latitude, longitude);
        let alpha = (self.azimuth_deg + 2.0 * e[4]).to_radians();
        let hc = self.camera_height_m + 0.05 * e[5];
        let height = HEIGHT_M + 0.07 * e[6];
        let head_image = HEAD_M * IMAGE_M / self.distance_m;
        let v = IMAGE_M + 20e-6 * e[8];
        let u = (HEAD_M + 0.012 * e[7]) * v / (head_image + HALF_PIXEL_M * e[9]);
        let length = height * east.hypot(north) / up;
        let (sx, sy) = (-length * east / east.hypot(north), -length * north / east.hypot(north));
        let (rx, ry) = (sx * alpha.cos() + sy * alpha.sin(), -sx * alpha.sin() + sy * alpha.cos());
        let mx = v * rx / (u + ry);
        let my = hc * v * (1.0 / (u + ry) - 1.0 / u);
        let eta = my.atan2(mx.abs());
        (0.75 * PI - eta / 2.0).to_degrees()
    }

    fn monte_carlo_deg(&self, draws: usize) -> f64 {
        let mut numbers = Normal(11);
        let (mut sum, mut squares) = (0.0, 0.0);
        let centre = self.beta_deg(&[0.0; 10]);
        for _ in 0..draws {
            let beta = self.beta_deg(&std::array::from_fn(|_| numbers.next())) - centre;
            sum += beta;
            squares += beta * beta;
        }
        (squares / draws as f64 - (sum / draws as f64).powi(2)).sqrt()
    }
}

trait RoundTo {
    fn round_to(self, unit: f64) -> Self;
}

impl RoundTo for f64 {
    fn round_to(self, unit: f64) -> f64 {
        (self / unit).round() * unit
    }
}

/// Repeatable normal numbers (Box-Muller over a linear congruential generator).
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

#[test]
fn deviation_agrees_with_monte_carlo_where_first_order_holds() {
    for case in &CASES {
        let deviation = case.deviation();
        // 60,000 samples give a standard deviation to 0.3 %.
        let monte_carlo = case.monte_carlo_deg(60_000);
        let first_order = f64::from(deviation.beta_deg);
        println!(
            "{}: beta {:.3} deg, first order {first_order:.4}, Monte Carlo {monte_carlo:.4}, sun azimuth {:.3}, {:?}",
            case.name,
            case.beta_deg(&[0.0; 10]),
            deviation.sun_azimuth_deg,
            deviation.reliability
        );
        if case.name == "S3" {
            assert_eq!(deviation.reliability, Reliability::ShadowNearCamera);
            assert!(monte_carlo > 3.0 * first_order);
        } else {
            assert_eq!(deviation.reliability, Reliability::FirstOrder, "{}", case.name);
            assert!((first_order / monte_carlo - 1.0).abs() < 0.05, "{}", case.name);
        }
    }
}

#[test]
fn shadow_angle_agrees_with_f64() {
    let mut largest = 0.0_f64;
    let mut compared = 0;
    for case in &CASES {
        for step in 0..48 {
            let case = Case { hour: 0.5 * f64::from(step), ..*case };
            let [_, _, up] = sun_f64(
                days_since_epoch(case.time()),
                case.latitude_deg.to_radians(),
                case.longitude_deg.to_radians(),
            );
            let shadow = Shadow::at(case.time(), &case.place(), &case.geometry());
            if up.asin().to_degrees() < 3.1 {
                continue;
            }
            let shadow = shadow.unwrap();
            // In the camera's plane the image is at infinity with either sign.
            if shadow.end_distance_m.abs() < 1e-3 {
                continue;
            }
            largest = largest.max((f64::from(shadow.beta_deg) - case.beta_deg(&[0.0; 10])).abs());
            compared += 1;
        }
    }
    println!("{compared} angles: {largest:.6} deg");
    assert!(compared > 80 && largest < TOLERANCE_DEG, "{largest}");
}

#[test]
fn a_shadow_has_the_direction_that_one_expects() {
    // Noon in the north: the sun is south, the shadow points north. A camera looking north sees it go
    // straight up from the feet, one looking west to the right.
    let noon = unix_seconds(2023, 6, 21, 12 * 3600);
    let greenwich = place(50.0, 0.5);
    let camera = |azimuth_deg: f32| Geometry {
        azimuth: BinaryAngle::from_degrees(azimuth_deg),
        camera_height_m: 2.0,
        distance_m: 8.0,
        lateral_m: 0.0,
        height_m: 1.7,
    };
    let north = Shadow::at(noon, &greenwich, &camera(0.0)).unwrap();
    assert!(north.eta_deg < -85.0 && north.beta_deg > 177.0, "{north:?}");
    let west = Shadow::at(noon, &greenwich, &camera(90.0)).unwrap();
    assert!(!west.mirrored && west.eta_deg.abs() < 3.0 && (west.beta_deg - 135.0).abs() < 2.0, "{west:?}");
    let east = Shadow::at(noon, &greenwich, &camera(-90.0)).unwrap();
    assert!(east.mirrored, "{east:?}");
    let elevation = Sun::at(noon, &greenwich).elevation_deg();
    assert!((west.length_m - 1.7 / elevation.to_radians().tan()).abs() < 1e-3);
}

/// A sun at this elevation and azimuth (clockwise from north).
fn sun_at(elevation_deg: f64, azimuth_deg: f64) -> Sun {
    let ((sin, cos), (east, north)) =
        (elevation_deg.to_radians().sin_cos(), azimuth_deg.to_radians().sin_cos());
    Sun { east: (cos * east) as f32, north: (cos * north) as f32, up: sin as f32 }
}

#[test]
fn a_shadow_of_a_subject_off_the_axis_is_that_of_a_pinhole() {
    const HC: f64 = 1.3;
    let (mut in_front, mut behind) = (0, 0);
    for (elevation, distance) in [(20.0_f64, 9.0_f64), (50.0, 4.0), (12.0, 3.0)] {
        for lateral in [-2.5_f64, 0.8] {
            for turn in 0..12 {
                let (azimuth, camera) = (f64::from(turn) * 30.0 + 7.0, 25.0_f64);
                let geometry = Geometry {
                    azimuth: BinaryAngle::from_degrees(camera as f32),
                    camera_height_m: HC as f32,
                    distance_m: distance as f32,
                    lateral_m: lateral as f32,
                    height_m: HEIGHT_M as f32,
                };
                let shadow = Shadow::of(&sun_at(elevation, azimuth), &geometry).unwrap();
                let length = HEIGHT_M / elevation.to_radians().tan();
                // Away from the sun; the camera looks `camera` anticlockwise from north.
                let (sin, cos) = (azimuth + 180.0 + camera).to_radians().sin_cos();
                let (right, forward) = (length * sin, length * cos);
                let end = distance + forward;
                let mx = (lateral + right) / end - lateral / distance;
                let my = HC * (1.0 / end - 1.0 / distance);
                let eta = my.atan2(mx.abs()).to_degrees();
                let case = format!("{elevation} {distance} {lateral} {azimuth}: {shadow:?}");
                assert!((f64::from(shadow.eta_deg) - eta).abs() < 0.01, "{case}: {eta}");
                assert!((f64::from(shadow.beta_deg) - (135.0 - eta / 2.0)).abs() < 0.01, "{case}");
                assert_eq!(shadow.mirrored, mx < 0.0, "{case}");
                assert!((f64::from(shadow.length_m) - length).abs() < 1e-3, "{case}");
                assert!((f64::from(shadow.end_distance_m) - end).abs() < 1e-3, "{case}");
                *(if end > 0.0 { &mut in_front } else { &mut behind }) += 1;
            }
        }
    }
    assert!(in_front > 30 && behind > 5, "{in_front} {behind}");
}

#[test]
fn a_shadow_along_the_line_of_sight_may_be_on_either_side() {
    let (time, place) = (CASES[1].time(), CASES[1].place());
    let sun = Sun::at(time, &place);
    for (off_deg, expected) in
        [(0.0, Reliability::EitherSide), (0.5, Reliability::EitherSide), (90.0, Reliability::FirstOrder)]
    {
        // The shadow falls away from the camera, or this much to the right.
        let azimuth = BinaryAngle::from_degrees(180.0 - sun.azimuth_deg() + off_deg);
        let geometry = Geometry { azimuth, distance_m: 9.0, ..CASES[1].geometry() };
        let shadow = Shadow::of(&sun, &geometry).unwrap();
        let deviation = shadow.deviation(time, &place, &geometry, &CASES[1].deviations());
        assert_eq!(deviation.reliability, expected, "{off_deg}: {shadow:?} {deviation:?}");
    }
}

#[test]
fn the_lowest_and_the_highest_sun_are_limited() {
    let geometry = CASES[0].geometry();
    let of = |elevation_deg| Shadow::of(&sun_at(elevation_deg, 200.0), &geometry);
    assert!(matches!(of(2.99), Err(Error::SunTooLow { elevation_deg }) if elevation_deg > 2.98));
    assert!(of(3.01).is_ok() && of(89.99).is_ok());
    assert!(matches!(of(89.995), Err(Error::SunOverhead { .. })));
}

#[test]
fn no_angle_without_a_shadow() {
    let place = place(50.0, 0.0);
    let midnight = unix_seconds(2023, 6, 21, 0);
    let geometry = CASES[0].geometry();
    assert!(matches!(Shadow::at(midnight, &place, &geometry), Err(Error::SunTooLow { .. })));
    let overhead = Sun { east: 0.0, north: 0.0, up: 1.0 };
    assert!(matches!(Shadow::of(&overhead, &geometry), Err(Error::SunOverhead { .. })));
    let broken = Sun { east: f32::NAN, north: 0.0, up: 1.0 };
    assert!(matches!(Shadow::of(&broken, &geometry), Err(Error::SunTooLow { .. })));
    let noon = unix_seconds(2023, 6, 21, 12 * 3600);
    for value_m in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        for (name, flat) in [
            ("camera height", Geometry { camera_height_m: value_m, ..geometry }),
            ("distance of the subject", Geometry { distance_m: value_m, ..geometry }),
            ("height of the subject", Geometry { height_m: value_m, ..geometry }),
        ] {
            let error = Shadow::at(noon, &place, &flat).unwrap_err();
            assert!(matches!(error, Error::Senseless { what, .. } if what == name), "{error}");
        }
    }
    for lateral_m in [f32::NAN, f32::INFINITY] {
        let error = Shadow::at(noon, &place, &Geometry { lateral_m, ..geometry }).unwrap_err();
        assert!(matches!(error, Error::Senseless { what: "offset of the subject", .. }), "{error}");
    }
}

proptest! {
    #[test]
    fn angles_stay_in_their_ranges(
        time in any::<i64>(), latitude in -900_000_000..=900_000_000_i32, longitude in any::<i32>(),
        azimuth in any::<u32>(), u in 0.1_f32..100.0, hc in 0.1_f32..20.0, x0 in -20.0_f32..20.0,
    ) {
        let place = Place {
            latitude: BinaryAngle::from_degrees_e7(latitude),
            longitude: BinaryAngle::from_degrees_e7(longitude),
        };
        let sun = Sun::at(time, &place);
        prop_assert!((-90.1..=90.1).contains(&sun.elevation_deg()));
        prop_assert!((0.0..=360.0).contains(&sun.azimuth_deg()));
        let geometry = Geometry {
            azimuth: BinaryAngle::from_units(azimuth),
            camera_height_m: hc,
            distance_m: u,
            lateral_m: x0,
            height_m: 1.7,
        };
        if let Ok(shadow) = Shadow::of(&sun, &geometry) {
            prop_assert!((90.0..=180.0).contains(&shadow.beta_deg), "{shadow:?}");
            let deviation = shadow.deviation(time, &place, &geometry, &CASES[0].deviations());
            prop_assert!(deviation.beta_deg >= 0.0, "{deviation:?}");
        }
    }
}
