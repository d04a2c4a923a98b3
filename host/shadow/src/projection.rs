//! Shadow on the ground (Li 2014, eq. 8.1 and 8.9 to 8.13) and in the image (8.14 to 8.20). Corrected: the lateral
//! component includes the subject's offset X0, `m_x = v ((X0 + r_x) / (u + r_y) - X0 / u)` (missing in 8.18); angles
//! use `atan2`; a pitched camera projects both ground points exactly.

use super::camera::{Camera, CameraFile};
use crate::sun::SunPosition;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// Lower suns cast shadows of many body lengths with uncertain angles.
pub const LOWEST_SUN_DEG: f64 = 3.0;

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShadowError {
    #[error(
        "the sun stands at {elevation_deg:.2} deg: no usable shadow below {LOWEST_SUN_DEG} deg; check time, latitude and longitude"
    )]
    SunTooLow { elevation_deg: f64 },
    #[error(
        "the lamp hangs {up_m} m above the ground: no usable shadow below {least_m:.2} m, a tenth above the subject's head"
    )]
    LampTooLow { up_m: f64, least_m: f64 },
    #[error("the mask is empty: no subject was found")]
    EmptyMask,
    #[error(
        "the mask has {mask_height} x {mask_width} pixels, the camera file {camera_height} x {camera_width}"
    )]
    Shape { mask_height: usize, mask_width: usize, camera_height: usize, camera_width: usize },
    #[error("the subject's distance of {distance_m} m is not one that the camera can see")]
    Distance { distance_m: f64 },
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroundShadow {
    pub rx_m: f64,
    /// Along the viewing direction (positive = away from the camera).
    pub ry_m: f64,
    /// From the feet to the tip of the head's shadow.
    pub length_m: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Subject {
    /// Distance u from the lens along the ground.
    pub distance_m: f64,
    /// Offset X0 to the right of the optical axis.
    pub offset_m: f64,
    pub height_m: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageShadow {
    pub foot_px: [f64; 2],
    /// Image of the shadow of the head.
    pub tip_px: [f64; 2],
    /// Tip minus foot: (m_x, m_y).
    pub m_px: [f64; 2],
    /// Direction from +x towards +y (down): eta of eq. 8.20 by atan2.
    pub eta_rad: f64,
    /// Rotation of the silhouette (mirrored if m_x <= 0) that points the bisector down: `3 pi / 4 - eta / 2`.
    pub beta_rad: f64,
    pub mirrored: bool,
    pub height_px: f64,
    /// Shortened at the near image border (8.19).
    pub shortened: bool,
}

/// Shadow of a person on level ground; fails for a sun below [`LOWEST_SUN_DEG`].
pub fn on_ground(sun: SunPosition, height_m: f64, camera: &Camera) -> Result<GroundShadow, ShadowError> {
    if sun.elevation_deg.is_nan() || sun.elevation_deg < LOWEST_SUN_DEG {
        return Err(ShadowError::SunTooLow { elevation_deg: sun.elevation_deg });
    }
    let length_m = height_m / sun.elevation_deg.to_radians().tan();
    // Angle from east, anticlockwise: away from the sun (8.9), in the camera's frame (8.13).
    let direction = (270.0 - sun.azimuth_deg - camera.azimuth_deg).to_radians();
    Ok(GroundShadow { rx_m: length_m * direction.cos(), ry_m: length_m * direction.sin(), length_m })
}

/// Projects foot and tip; fails for a subject not in front of the lens.
pub fn in_image(shadow: GroundShadow, subject: Subject, camera: &Camera) -> Result<ImageShadow, ShadowError> {
    let (foot_px, height_px) = foot_and_height(subject, camera)?;
    // The lowest image row limits the visible ground; a nearer tip is shortened along the shadow (8.19).
    let near_m = camera
        .ground_point([camera.principal_point()[0], camera.height_px as f64 - 1.0])
        .map_or(0.1 * subject.distance_m, |ground| ground[1].min(0.9 * subject.distance_m));
    let (mut fraction, mut shortened) = (1.0, false);
    if subject.distance_m + shadow.ry_m < near_m {
        fraction = (near_m - subject.distance_m) / shadow.ry_m;
        shortened = true;
    }
    let tip = [subject.offset_m + fraction * shadow.rx_m, subject.distance_m + fraction * shadow.ry_m, 0.0];
    let tip_px = camera.project(tip).ok_or(ShadowError::Distance { distance_m: tip[1] })?;
    let m_px = [tip_px[0] - foot_px[0], tip_px[1] - foot_px[1]];
    Ok(ImageShadow::new(foot_px, m_px, height_px, shortened))
}

/// Shadow with a known image direction, radians from right towards down; `length_px` gives its length from
/// the foot. Fails for a subject not in front of the lens.
pub fn of_direction(
    eta_rad: f64,
    subject: Subject,
    camera: &Camera,
    length_px: impl FnOnce([f64; 2]) -> f64,
) -> Result<ImageShadow, ShadowError> {
    let (foot_px, height_px) = foot_and_height(subject, camera)?;
    let (sin, cos) = eta_rad.sin_cos();
    // At least 1, because a direction needs a length.
    let length = length_px(foot_px).max(1.0);
    Ok(ImageShadow::new(foot_px, [length * cos, length * sin], height_px, false))
}

fn foot_and_height(subject: Subject, camera: &Camera) -> Result<([f64; 2], f64), ShadowError> {
    let seen = |up_m| {
        let point = [subject.offset_m, subject.distance_m, up_m];
        camera.project(point).ok_or(ShadowError::Distance { distance_m: subject.distance_m })
    };
    let (foot_px, head_px) = (seen(0.0)?, seen(subject.height_m)?);
    Ok((foot_px, foot_px[1] - head_px[1]))
}

impl ImageShadow {
    fn new(foot_px: [f64; 2], m_px: [f64; 2], height_px: f64, shortened: bool) -> Self {
        Self {
            foot_px,
            tip_px: [foot_px[0] + m_px[0], foot_px[1] + m_px[1]],
            m_px,
            eta_rad: m_px[1].atan2(m_px[0]),
            beta_rad: rotation_angle(m_px),
            mirrored: m_px[0] <= 0.0,
            height_px,
            shortened,
        }
    }
}

/// Angle beta (8.20) of a shadow (m_x, m_y), mirrored to the right: in [pi/2, pi].
pub fn rotation_angle(m_px: [f64; 2]) -> f64 {
    let eta = m_px[1].atan2(m_px[0].abs());
    (3.0 * FRAC_PI_4 - 0.5 * eta).clamp(FRAC_PI_2, 2.0 * FRAC_PI_2)
}

/// Distance by the head's width in the image (8.17): `u = w v / w_i`.
pub fn distance_from_head_m(file: &CameraFile, head_width_px: f64) -> f64 {
    file.subject.head_width_m * file.camera.focal_px() / head_width_px
}

/// By the head's row: a level camera at height Hc sees it `f (H - Hc) / u` above the horizon; `None` if H is near Hc.
pub fn distance_from_head_row_m(file: &CameraFile, top_row_px: f64) -> Option<f64> {
    let camera = &file.camera;
    let above_m = file.subject.height_m - camera.height_m;
    let up = (camera.principal_point()[1] - top_row_px) / camera.focal_px();
    let (s, c) = camera.pitch_deg.to_radians().sin_cos();
    // Slope of the ray above the horizontal.
    let slope = (up * c - s) / (c + up * s);
    let distance_m = above_m / slope;
    (above_m.abs() > 0.25 && distance_m.is_finite() && distance_m > 0.5).then_some(distance_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(azimuth_deg: f64) -> Camera {
        CameraFile::parse(&format!(
            "[camera]\nheight_m = 1.5\nazimuth_deg = {azimuth_deg}\nfocal_length_mm = 4.0\npixel_um = 6.0\n"
        ))
        .expect("valid")
        .camera
    }

    #[test]
    fn shadows_point_away_from_the_sun() {
        // Sun in the south-west, camera looking north: shadow to the right and away (Li 2014, fig. 8.1).
        let sun = SunPosition { elevation_deg: 45.0, azimuth_deg: 225.0 };
        let shadow = on_ground(sun, 2.0, &camera(0.0)).expect("sun is up");
        assert!((shadow.length_m - 2.0).abs() < 1e-12);
        assert!((shadow.rx_m - 2_f64.sqrt()).abs() < 1e-9 && (shadow.ry_m - 2_f64.sqrt()).abs() < 1e-9);
        // Rotated 90 deg anticlockwise the camera looks west: north-east is behind it, to the right.
        let turned = on_ground(sun, 2.0, &camera(90.0)).expect("sun is up");
        assert!((turned.rx_m - 2_f64.sqrt()).abs() < 1e-9 && (turned.ry_m + 2_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn the_level_camera_agrees_with_the_closed_form_with_lateral_offset() {
        let (camera, shadow) = (camera(0.0), GroundShadow { rx_m: 1.1, ry_m: -0.8, length_m: 1.36 });
        let subject = Subject { distance_m: 6.0, offset_m: 0.9, height_m: 1.7 };
        let image = in_image(shadow, subject, &camera).expect("visible");
        let v = camera.focal_px();
        let mx = v * ((0.9 + 1.1) / (6.0 - 0.8) - 0.9 / 6.0);
        let my = 1.5 * v * (1.0 / (6.0 - 0.8) - 1.0 / 6.0);
        assert!((image.m_px[0] - mx).abs() < 1e-9 && (image.m_px[1] - my).abs() < 1e-9);
        let eta = (-1.5 * -0.8_f64).atan2(6.0 * 1.1 - 0.9 * -0.8);
        assert!((image.eta_rad - eta).abs() < 1e-12);
        assert!((image.height_px - v * 1.7 / 6.0).abs() < 1e-9);
    }

    #[test]
    fn rejects_a_low_sun_and_shortens_a_shadow_behind_the_camera() {
        let low = SunPosition { elevation_deg: 1.0, azimuth_deg: 90.0 };
        assert!(matches!(on_ground(low, 1.75, &camera(0.0)), Err(ShadowError::SunTooLow { .. })));
        let long = GroundShadow { rx_m: 1.0, ry_m: -9.0, length_m: 9.06 };
        let subject = Subject { distance_m: 6.0, offset_m: 0.0, height_m: 1.75 };
        let image = in_image(long, subject, &camera(0.0)).expect("visible");
        assert!(image.shortened && image.m_px[1] > 0.0);
        assert!((image.tip_px[1] - 479.0).abs() < 1e-9, "the last row: {image:?}");
    }

    #[test]
    fn estimates_the_distance_from_the_head() {
        let text = "[camera]\nheight_m = 0.8\nazimuth_deg = 0.0\npitch_deg = 5.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";
        let file = CameraFile::parse(text).expect("valid");
        let top = file.camera.project([0.0, 7.0, 1.75]).expect("visible");
        let found = distance_from_head_row_m(&file, top[1]).expect("not at eye height");
        assert!((found - 7.0).abs() < 1e-9, "{found}");
        assert!((distance_from_head_m(&file, 0.17 * file.camera.focal_px() / 5.0) - 5.0).abs() < 1e-12);
    }

    #[test]
    fn the_silhouette_is_turned_by_the_shadows_direction_after_mirroring_to_the_right() {
        for (m_px, beta_deg, mirrored) in [
            ([2.0, 0.0], 135.0, false),
            ([2.0, 2.0], 112.5, false),
            ([2.0, -2.0], 157.5, false),
            ([-2.0, 2.0], 112.5, true),
            ([-2.0, -2.0], 157.5, true),
            ([0.0, 3.0], 90.0, true),
            ([0.0, -3.0], 180.0, true),
        ] {
            let image = ImageShadow::new([10.0, 20.0], m_px, 50.0, false);
            assert!((image.beta_rad.to_degrees() - beta_deg).abs() < 1e-12, "{image:?}");
            assert_eq!(image.mirrored, mirrored, "{image:?}");
            assert_eq!(image.tip_px, [10.0 + m_px[0], 20.0 + m_px[1]]);
        }
    }

    #[test]
    fn a_sun_at_the_lowest_elevation_has_a_shadow() {
        let of = |elevation_deg| {
            on_ground(SunPosition { elevation_deg, azimuth_deg: 90.0 }, 1.75, &camera(0.0)).is_ok()
        };
        assert_eq!([f64::NAN, 2.999, LOWEST_SUN_DEG].map(of), [false, false, true]);
    }
}
