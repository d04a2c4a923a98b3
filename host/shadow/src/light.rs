//! Light source: sun, lamp, or a shadow direction measured in the picture (Li 2014, section 9.2).

use super::{
    camera::Camera,
    projection::{GroundShadow, ImageShadow, ShadowError, Subject, in_image, of_direction, on_ground},
};
use crate::sun::SunPosition;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    Sun(SunPosition),
    /// Small lamp, in the camera's frame on the ground below the lens.
    Lamp(Lamp),
    /// Shadow direction in the picture, from right towards down.
    Direction {
        /// Angle eta of eq. 8.20.
        eta_rad: f64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    pub right_m: f64,
    pub ahead_m: f64,
    pub up_m: f64,
}

impl From<SunPosition> for Light {
    fn from(sun: SunPosition) -> Self {
        Self::Sun(sun)
    }
}

impl Light {
    pub fn check(&self, height_m: f64, camera: &Camera) -> Result<(), ShadowError> {
        match self {
            Self::Sun(sun) => on_ground(*sun, height_m, camera).map(drop),
            Self::Lamp(lamp) => lamp.check(height_m),
            Self::Direction { .. } => Ok(()),
        }
    }

    /// Ground position (right, ahead) of the shadow of a point (right, ahead, up), metres; `None` at or below
    /// the ground, for too low a light, or without a light position.
    pub fn thrown_to(&self, [right_m, ahead_m, up_m]: [f64; 3], camera: &Camera) -> Option<[f64; 2]> {
        if up_m <= 0.0 {
            return None;
        }
        let subject = Subject { distance_m: ahead_m, offset_m: right_m, height_m: up_m };
        let ground = match self {
            Self::Sun(sun) => on_ground(*sun, up_m, camera).ok()?,
            Self::Lamp(lamp) => lamp.on_ground(subject).ok()?,
            Self::Direction { .. } => return None,
        };
        Some([right_m + ground.rx_m, ahead_m + ground.ry_m])
    }

    /// The subject's shadow in the image. For a known direction only, `length_px` gives the length from foot
    /// and direction. Fails as [`Light::check`], and for a subject not in front of the lens.
    pub fn shadow_of(
        &self,
        subject: Subject,
        camera: &Camera,
        length_px: impl FnOnce([f64; 2], f64) -> f64,
    ) -> Result<ImageShadow, ShadowError> {
        match self {
            Self::Sun(sun) => in_image(on_ground(*sun, subject.height_m, camera)?, subject, camera),
            Self::Lamp(lamp) => in_image(lamp.on_ground(subject)?, subject, camera),
            Self::Direction { eta_rad } => {
                of_direction(*eta_rad, subject, camera, |foot_px| length_px(foot_px, *eta_rad))
            }
        }
    }
}

impl Lamp {
    fn check(&self, height_m: f64) -> Result<(), ShadowError> {
        /// A lamp at head height casts an infinite shadow.
        const ABOVE_HEAD: f64 = 1.1;
        if self.up_m >= ABOVE_HEAD * height_m {
            return Ok(());
        }
        Err(ShadowError::LampTooLow { up_m: self.up_m, least_m: ABOVE_HEAD * height_m })
    }

    /// The ray over the head meets the ground beyond the feet by their distance from the lamp times `H / (up - H)`.
    fn on_ground(&self, subject: Subject) -> Result<GroundShadow, ShadowError> {
        self.check(subject.height_m)?;
        let stretch = subject.height_m / (self.up_m - subject.height_m);
        let rx_m = stretch * (subject.offset_m - self.right_m);
        let ry_m = stretch * (subject.distance_m - self.ahead_m);
        Ok(GroundShadow { rx_m, ry_m, length_m: rx_m.hypot(ry_m) })
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::CameraFile;
    use super::*;

    fn camera() -> Camera {
        let text = "[camera]\nheight_m = 1.2\nazimuth_deg = 30.0\npitch_deg = 4.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";
        CameraFile::parse(text).expect("valid").camera
    }

    const SUBJECT: Subject = Subject { distance_m: 6.0, offset_m: -0.4, height_m: 1.75 };

    #[test]
    fn a_distant_lamp_equals_the_sun() {
        let camera = camera();
        let sun = SunPosition { elevation_deg: 35.0, azimuth_deg: 200.0 };
        // Towards the sun in the camera's frame, opposite to the shadow.
        let ground = on_ground(sun, 1.0, &camera).expect("sun is up");
        let far_m = 1e7;
        let lamp = Light::Lamp(Lamp {
            right_m: SUBJECT.offset_m - far_m * ground.rx_m,
            ahead_m: SUBJECT.distance_m - far_m * ground.ry_m,
            up_m: far_m,
        });
        let [by_sun, by_lamp] = [Light::Sun(sun), lamp]
            .map(|light| light.shadow_of(SUBJECT, &camera, |_, _| 0.0).expect("visible"));
        // A lamp at 10,000 km is off by the stature over that distance.
        assert!((by_sun.tip_px[0] - by_lamp.tip_px[0]).abs() < 1e-3, "{by_sun:?} {by_lamp:?}");
        assert!((by_sun.tip_px[1] - by_lamp.tip_px[1]).abs() < 1e-3, "{by_sun:?} {by_lamp:?}");
    }

    #[test]
    fn lamp_head_and_tip_are_in_line() {
        let lamp = Lamp { right_m: 1.5, ahead_m: 8.0, up_m: 3.0 };
        let shadow = lamp.on_ground(SUBJECT).expect("above the head");
        // At head height the ray from lamp to tip is over the feet.
        let part = (3.0 - SUBJECT.height_m) / 3.0;
        let tip = [SUBJECT.offset_m + shadow.rx_m, SUBJECT.distance_m + shadow.ry_m];
        assert!((1.5 + part * (tip[0] - 1.5) - SUBJECT.offset_m).abs() < 1e-12);
        assert!((8.0 + part * (tip[1] - 8.0) - SUBJECT.distance_m).abs() < 1e-12);
    }

    #[test]
    fn rejects_a_lamp_below_the_head() {
        let error = Light::Lamp(Lamp { right_m: 0.0, ahead_m: 3.0, up_m: 1.8 }).check(1.75, &camera());
        assert_eq!(error, Err(ShadowError::LampTooLow { up_m: 1.8, least_m: 1.1 * 1.75 }));
    }

    #[test]
    fn uses_a_measured_direction_unchanged() {
        let shadow =
            Light::Direction { eta_rad: 0.3 }.shadow_of(SUBJECT, &camera(), |_, _| 80.0).expect("visible");
        assert!((shadow.eta_rad - 0.3).abs() < 1e-12 && !shadow.mirrored && !shadow.shortened);
        assert!((shadow.m_px[0].hypot(shadow.m_px[1]) - 80.0).abs() < 1e-9);
    }
}
