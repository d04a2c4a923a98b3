//! Standard deviation of the cutting angle beta: error propagation (Li 2014, eq. 8.21 to 8.37, corrected).
//!
//! The printed chain (elevation twice, wrong root, no covariances) is ten times too large. Here beta is differentiated
//! as a whole, by central differences. For a level camera, with `A = -Hc r_y`, `B = u r_x - X0 r_y` (X0 = u times a fixed image
//! slope) and `D = A^2 + B^2`, the result is
//!
//! `s_beta^2 = 1/4 [ (Hc u s^2 / D)^2 (s_psi^2 + s_alpha^2) + (A B / (u D))^2 s_u^2 + (B r_y / D)^2 s_Hc^2
//! ]`, `s_u^2 = (v / w_i)^2 s_w^2 + (w / w_i)^2 s_v^2 + (u / w_i)^2 s_wi^2`.
//!
//! Agrees with Monte Carlo to 2 %, unless the shadow's tip nears the camera ([`Uncertainty::first_order_holds`]).

use super::camera::{Camera, CameraFile};
use super::projection::{GroundShadow, ShadowError, Subject, in_image, on_ground};
use crate::sun::{self, Model, Place, SunError};
use chrono::{DateTime, TimeDelta, Utc};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    pub azimuth_rad: f64,
    pub elevation_rad: f64,
    pub distance_m: f64,
    pub tip_distance_m: f64,
    pub beta_rad: f64,
    /// False if the tip is within three standard deviations of the lens' plane: `beta_rad` is then invalid.
    pub first_order_holds: bool,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UncertaintyError {
    #[error(transparent)]
    Sun(#[from] SunError),
    #[error(transparent)]
    Shadow(#[from] ShadowError),
}

#[derive(Clone, Copy, Debug)]
struct HorizonPartials {
    azimuth: [f64; 3],
    elevation: [f64; 3],
}

/// Derivative of [`sun::to_horizon`] in closed form.
fn horizon_partials(declination: f64, hour_angle: f64, latitude: f64) -> HorizonPartials {
    let ((sd, cd), (sh, ch), (sl, cl)) = (declination.sin_cos(), hour_angle.sin_cos(), latitude.sin_cos());
    let (east, north) = (-cd * sh, sd * cl - cd * sl * ch);
    // d/d(declination, hour angle, latitude) of up, east and north.
    let up_d = [cd * sl - sd * cl * ch, -cd * cl * sh, sd * cl - cd * sl * ch];
    let east_d = [sd * sh, -cd * ch, 0.0];
    let north_d = [cd * cl + sd * sl * ch, cd * sl * sh, -sd * sl - cd * cl * ch];
    let ground2 = east * east + north * north;
    HorizonPartials {
        azimuth: std::array::from_fn(|i| (north * east_d[i] - east * north_d[i]) / ground2),
        elevation: std::array::from_fn(|i| up_d[i] / ground2.sqrt()),
    }
}

/// Change of declination and hour angle (radians) per day at the same time of day.
fn per_day(time: DateTime<Utc>, model: Model) -> [f64; 2] {
    let at = |days| sun::equatorial(time + TimeDelta::days(days), model);
    let (before, after) = (at(-1), at(1));
    let turn = (after.greenwich_hour_angle_rad - before.greenwich_hour_angle_rad).rem_euclid(TAU);
    let hour_angle = if turn > PI { turn - TAU } else { turn };
    [0.5 * (after.declination_rad - before.declination_rad), 0.5 * hour_angle]
}

/// Propagates the camera file's standard deviations to beta. Fails for an invalid place, too low a sun, and a subject not in
/// front of the lens.
pub fn propagate(
    file: &CameraFile,
    time: DateTime<Utc>,
    place: Place,
    model: Model,
    subject: Subject,
) -> Result<Uncertainty, UncertaintyError> {
    let sd = &file.standard_deviations;
    let position = sun::position(time, place, model)?;
    let shadow = on_ground(position, subject.height_m, &file.camera)?;
    let equatorial = sun::equatorial(time, model);
    let hour_angle = equatorial.greenwich_hour_angle_rad + place.longitude_deg.to_radians();
    let partial = horizon_partials(equatorial.declination_rad, hour_angle, place.latitude_deg.to_radians());
    let [declination_per_day, hour_angle_per_day] = per_day(time, model);
    // Day moves declination and hour angle together, so both paths are added before squaring (the error in
    // 8.24 and 8.25).
    let variance = |d: [f64; 3]| {
        let hour = (15_f64.to_radians() * sd.time_h).powi(2) + sd.longitude_deg.to_radians().powi(2);
        ((d[0] * declination_per_day + d[1] * hour_angle_per_day) * sd.day).powi(2)
            + d[1] * d[1] * hour
            + (d[2] * sd.latitude_deg.to_radians()).powi(2)
    };
    let (azimuth, elevation) = (variance(partial.azimuth), variance(partial.elevation));
    // A measured distance has no uncertainty here.
    let known = file.subject.distance_m.is_some();
    let distance = if known { 0.0 } else { distance_variance(file, subject.distance_m) };
    let tip = tip_variance(file, position.elevation_deg.to_radians(), shadow, azimuth, elevation) + distance;
    let beta = beta_variance(file, shadow, subject, azimuth, distance)?;
    let tip_m = subject.distance_m + shadow.ry_m;
    Ok(Uncertainty {
        azimuth_rad: azimuth.sqrt(),
        elevation_rad: elevation.sqrt(),
        distance_m: distance.sqrt(),
        tip_distance_m: tip.sqrt(),
        beta_rad: beta.sqrt(),
        first_order_holds: tip_m > 3.0 * tip.sqrt(),
    })
}

fn distance_variance(file: &CameraFile, distance_m: f64) -> f64 {
    let (camera, sd) = (&file.camera, &file.standard_deviations);
    let v_m = 1e-3 * camera.focal_length_mm;
    let w_m = file.subject.head_width_m;
    let wi_m = w_m * v_m / distance_m;
    (v_m / wi_m * sd.head_width_m).powi(2)
        + (w_m / wi_m * 1e-6 * sd.image_distance_um).powi(2)
        + (distance_m / wi_m * 1e-6 * camera.pixel_um * sd.head_width_px).powi(2)
}

/// Variance of r_y: length by stature and elevation (8.28), direction by azimuth and camera.
fn tip_variance(
    file: &CameraFile,
    elevation: f64,
    shadow: GroundShadow,
    azimuth_var: f64,
    elevation_var: f64,
) -> f64 {
    let sd = &file.standard_deviations;
    let height_m = shadow.length_m * elevation.tan();
    let length_var = (height_m / elevation.sin().powi(2)).powi(2) * elevation_var
        + (sd.subject_height_m / elevation.tan()).powi(2);
    (shadow.ry_m / shadow.length_m).powi(2) * length_var
        + shadow.rx_m.powi(2) * (azimuth_var + sd.azimuth_deg.to_radians().powi(2))
}

/// Variance of beta, half of that of the shadow's direction in the image, which does not depend on the shadow's length.
fn beta_variance(
    file: &CameraFile,
    shadow: GroundShadow,
    subject: Subject,
    azimuth_var: f64,
    distance_var: f64,
) -> Result<f64, ShadowError> {
    /// Of the central differences: radians of the direction on the ground, and shares of distance and camera height.
    const STEP: f64 = 1e-4;
    let sd = &file.standard_deviations;
    let direction = |[turn, further, higher]: [f64; 3]| -> Result<f64, ShadowError> {
        let (sin, cos) = turn.sin_cos();
        let turned = GroundShadow {
            rx_m: cos * shadow.rx_m - sin * shadow.ry_m,
            ry_m: sin * shadow.rx_m + cos * shadow.ry_m,
            ..shadow
        };
        let subject = Subject {
            distance_m: (1.0 + further) * subject.distance_m,
            offset_m: (1.0 + further) * subject.offset_m,
            ..subject
        };
        let camera = Camera { height_m: (1.0 + higher) * file.camera.height_m, ..file.camera.clone() };
        Ok(in_image(turned, subject, &camera)?.eta_rad)
    };
    let mut variance = 0.0;
    for (step, step_variance) in [
        ([STEP, 0.0, 0.0], azimuth_var + sd.azimuth_deg.to_radians().powi(2)),
        ([0.0, STEP, 0.0], distance_var / subject.distance_m.powi(2)),
        ([0.0, 0.0, STEP], (sd.camera_height_m / file.camera.height_m).powi(2)),
    ] {
        let change = direction(step)? - direction(step.map(|part| -part))?;
        let slope = ((change + PI).rem_euclid(TAU) - PI) / (2.0 * STEP);
        variance += 0.25 * slope * slope * step_variance;
    }
    Ok(variance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivatives_of_azimuth_and_elevation_are_those_of_differences() {
        const STEP: f64 = 1e-5;
        for (declination, hour_angle, latitude) in [(0.4, 0.5, 0.9), (-0.3, -0.7, 0.6), (0.1, 1.1, -0.8)] {
            let found = horizon_partials(declination, hour_angle, latitude);
            for i in 0..3 {
                let at = |step: f64| {
                    let mut moved = [declination, hour_angle, latitude];
                    moved[i] += step;
                    let [declination, hour_angle, latitude] = moved;
                    sun::to_horizon(declination, hour_angle, latitude)
                };
                let (before, after) = (at(-STEP), at(STEP));
                let slope = |before: f64, after: f64| (after - before).to_radians() / (2.0 * STEP);
                let azimuth = slope(before.azimuth_deg, after.azimuth_deg);
                let elevation = slope(before.elevation_deg, after.elevation_deg);
                // Third derivatives times the squared step, and rounding divided by it.
                assert!((found.azimuth[i] - azimuth).abs() < 1e-8, "{i}: {azimuth} {:?}", found.azimuth);
                assert!(
                    (found.elevation[i] - elevation).abs() < 1e-8,
                    "{i}: {elevation} {:?}",
                    found.elevation
                );
            }
        }
    }

    fn file() -> CameraFile {
        let text = "[camera]\nheight_m = 1.2\nazimuth_deg = 130.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";
        CameraFile::parse(text).expect("valid")
    }

    #[test]
    fn the_variance_of_the_tip_is_that_of_differences() {
        let (file, subject_m) = (file(), 1.75);
        let (azimuth_deg, elevation_deg) = (70.0, 35.0_f64);
        let along = |azimuth_deg, elevation_deg, height_m| {
            let sun = sun::SunPosition { elevation_deg, azimuth_deg };
            on_ground(sun, height_m, &file.camera).expect("the sun is up")
        };
        let shadow = along(azimuth_deg, elevation_deg, subject_m);
        let [azimuth_var, elevation_var] = [0.02_f64.powi(2), 0.03_f64.powi(2)];
        const STEP: f64 = 1e-5;
        let by_azimuth = (along(azimuth_deg + STEP.to_degrees(), elevation_deg, subject_m).ry_m
            - along(azimuth_deg - STEP.to_degrees(), elevation_deg, subject_m).ry_m)
            / (2.0 * STEP);
        let by_elevation = (along(azimuth_deg, elevation_deg + STEP.to_degrees(), subject_m).ry_m
            - along(azimuth_deg, elevation_deg - STEP.to_degrees(), subject_m).ry_m)
            / (2.0 * STEP);
        let by_height = shadow.ry_m / subject_m;
        let sd = &file.standard_deviations;
        let expected = by_azimuth.powi(2) * (azimuth_var + sd.azimuth_deg.to_radians().powi(2))
            + by_elevation.powi(2) * elevation_var
            + (by_height * sd.subject_height_m).powi(2);
        let found = tip_variance(&file, elevation_deg.to_radians(), shadow, azimuth_var, elevation_var);
        // Third derivatives times the squared step, and rounding divided by it.
        assert!((found / expected - 1.0).abs() < 1e-7, "{found} {expected}");
    }

    /// For a level camera, in closed form.
    fn beta_variance_if_level(
        file: &CameraFile,
        shadow: GroundShadow,
        subject: Subject,
        vars: [f64; 2],
    ) -> f64 {
        let (hc, sd) = (file.camera.height_m, &file.standard_deviations);
        let u = subject.distance_m;
        let (a, b) = (-hc * shadow.ry_m, u * shadow.rx_m - subject.offset_m * shadow.ry_m);
        let d = a * a + b * b;
        let direction = hc * u * shadow.length_m.powi(2) / d;
        0.25 * (direction.powi(2) * (vars[0] + sd.azimuth_deg.to_radians().powi(2))
            + (a * b / (u * d)).powi(2) * vars[1]
            + (b * shadow.ry_m / d).powi(2) * sd.camera_height_m.powi(2))
    }

    #[test]
    fn the_variance_of_beta_is_the_closed_form_for_a_level_camera_and_another_with_pitch() {
        let mut file = file();
        file.camera.height_m = 3.0;
        let subject = Subject { distance_m: 3.0, offset_m: 0.3, height_m: 1.75 };
        let vars = [0.02_f64.powi(2), 0.3_f64.powi(2)];
        for (rx_m, ry_m) in [(2.4_f64, 0.8_f64), (-1.0, 1.5), (0.4, -2.0), (-2.0, -4.0)] {
            let shadow = GroundShadow { rx_m, ry_m, length_m: rx_m.hypot(ry_m) };
            let found = beta_variance(&file, shadow, subject, vars[0], vars[1]).expect("visible");
            let level = beta_variance_if_level(&file, shadow, subject, vars);
            // Third derivatives times the squared step.
            assert!((found / level - 1.0).abs() < 1e-5, "{rx_m} {ry_m}: {found} {level}");
        }
        // From a camera that looks down, a sideways shadow turns less with its direction and distance.
        file.camera.pitch_deg = 40.0;
        let shadow = GroundShadow { rx_m: 2.4, ry_m: 0.8, length_m: 2.4_f64.hypot(0.8) };
        let found = beta_variance(&file, shadow, subject, vars[0], vars[1]).expect("visible");
        let level = beta_variance_if_level(&file, shadow, subject, vars);
        assert!(found < 0.8 * level, "{found} {level}");
    }

    #[test]
    fn the_variance_of_the_distance_is_that_of_the_heads_width_and_its_image() {
        let file = file();
        let (sd, distance_m) = (&file.standard_deviations, 5.0);
        let focal_m = 4e-3;
        let in_image_m = file.subject.head_width_m * focal_m / distance_m;
        // The distance is a quotient: its relative variance is the sum of those of its parts.
        let relative = (sd.head_width_m / file.subject.head_width_m).powi(2)
            + (1e-6 * sd.image_distance_um / focal_m).powi(2)
            + (6e-6 * sd.head_width_px / in_image_m).powi(2);
        let found = distance_variance(&file, distance_m);
        assert!((found / (relative * distance_m * distance_m) - 1.0).abs() < 1e-12, "{found}");
    }
}
