//! First-order error propagation to beta, and its validity.
//!
//! `s_beta^2 = 1/4 [(Hc u s^2 / D)^2 (s_psi^2 + s_alpha^2) + (Hc rx ry / D)^2 s_u^2 + (u rx ry / D)^2 s_Hc^2]` with
//! `D = u^2 rx^2 + Hc^2 ry^2`, for a subject on the optical axis; the general form has `t = u rx - X0 ry` instead of
//! `u rx`. (Of Li 2014, eqs. 8.21 to 8.37: 8.24 needs the square of its sum, 8.27 counts the elevation twice, 8.36 and
//! 8.37 lack covariances; printed, they are ten times too large.) `s_psi` follows from day, hour, latitude and
//! longitude by the derivatives of the horizontal vector, `s_u` from `u = w v / wi`. Beta is independent of `H`.

use micromath::F32;

use super::{Geometry, RADIAN, Shadow};
use crate::angle::BinaryAngle;
use crate::sun::{Place, equatorial, horizontal};

/// Standard deviations of the inputs.
#[derive(Clone, Copy, PartialEq, Debug)]
#[allow(missing_docs, reason = "names and types describe these fields")]
pub struct Deviations {
    /// Day, with the hour unchanged.
    pub day: f32,
    pub time_h: f32,
    pub latitude_deg: f32,
    pub longitude_deg: f32,
    pub azimuth_deg: f32,
    pub camera_height_m: f32,
    pub height_m: f32,
    /// Distance of the subject: [`Deviations::of_distance`].
    pub distance_m: f32,
}

impl Deviations {
    /// For a distance `u = w v / wi` from a head of width `w`, imaged as `wi` at `v` (Li 2014, eq. 8.17); each with SD.
    pub fn of_distance(w: (f32, f32), v: (f32, f32), wi: (f32, f32)) -> f32 {
        let u = w.0 * v.0 / wi.0;
        u * root(square(w.1 / w.0) + square(v.1 / v.0) + square(wi.1 / wi.0))
    }
}

/// Validity of the first-order deviation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reliability {
    /// Valid to a few percent.
    FirstOrder,
    /// The shadow's end may lie next to or behind the camera: beta may jump, the deviation is too small.
    ShadowNearCamera,
    /// The shadow may point to either side: beta folds at the mirror, the deviation is wrong.
    EitherSide,
}

/// Standard deviation of beta.
#[derive(Clone, Copy, PartialEq, Debug)]
#[allow(missing_docs, reason = "names and types describe these fields")]
pub struct Deviation {
    pub beta_deg: f32,
    pub sun_azimuth_deg: f32,
    pub reliability: Reliability,
}

/// Required distance of the shadow's end from the camera, standard deviations.
const CLEARANCE: f32 = 4.0;

/// Required distance of eta from the fold at 90 deg, standard deviations.
const FOLD: f32 = 2.0;

impl Shadow {
    /// Standard deviation of beta for a shadow of [`Shadow::at`] with the same time, place and geometry.
    pub fn deviation(
        &self,
        unix_seconds: i64,
        place: &Place,
        geometry: &Geometry,
        given: &Deviations,
    ) -> Deviation {
        let (psi2, elevation2) = of_sun(unix_seconds, place, given);
        let direction2 = psi2 + square(given.azimuth_deg * RADIAN);
        let (u, hc) = (geometry.distance_m, geometry.camera_height_m);
        let (rx, ry, s) = (self.right_m, self.forward_m, self.length_m);
        let (across, down) = (u * rx - geometry.lateral_m * ry, hc * ry);
        let d = square(across) + square(down);
        // d eta by direction, u and Hc; the subject's offset is measured in the image, X0 = x u / v.
        let by_direction = hc * u * s * s / d;
        let by_distance = hc * across * ry / (u * d);
        let by_height = across * ry / d;
        let eta2 = square(by_direction) * direction2
            + square(by_distance * given.distance_m)
            + square(by_height * given.camera_height_m);
        let eta = root(eta2);
        // The end's distance u + ry: by u, by the shadow's length (height and elevation) and direction.
        let of_length2 = square(ry * given.height_m / geometry.height_m)
            + square(ry / self.sine_times_cosine(geometry)) * elevation2;
        let end = root(square(given.distance_m) + of_length2 + square(rx) * direction2);
        let fold = 90.0 * RADIAN - (self.eta_deg * RADIAN).abs();
        let reliability = if self.end_distance_m < CLEARANCE * end {
            Reliability::ShadowNearCamera
        } else if fold < FOLD * eta {
            Reliability::EitherSide
        } else {
            Reliability::FirstOrder
        };
        Deviation { beta_deg: eta / (2.0 * RADIAN), sun_azimuth_deg: root(psi2) / RADIAN, reliability }
    }

    /// `sin(elevation) cos(elevation)`: relative length change per change of elevation, inverted.
    fn sine_times_cosine(&self, geometry: &Geometry) -> f32 {
        let (s, h) = (self.length_m, geometry.height_m);
        s * h / (s * s + h * h)
    }
}

/// Variances of the sun's azimuth and elevation, radians squared.
fn of_sun(unix_seconds: i64, place: &Place, given: &Deviations) -> (f32, f32) {
    let sun = equatorial(unix_seconds);
    let sidereal = sun.sidereal;
    let at = horizontal(sun.vector, sidereal, place);
    // By the hour angle: the vector rotated by a quarter turn.
    let quarter = BinaryAngle::from_units(1 << 30);
    let turned = horizontal(sun.vector, sidereal.plus(quarter), place);
    // The polar component is independent of the hour angle.
    let polar = horizontal([0.0, 0.0, sun.vector[2]], sidereal, place);
    let by_hour_angle: [f32; 3] = core::array::from_fn(|i| turned[i] - polar[i]);
    let by_latitude = [0.0, -at[2], at[1]];
    // A day later at the same hour the sidereal time has advanced by 0.9856 deg, like the sun along the
    // ecliptic.
    let along = horizontal(sun.derivative, sidereal, place);
    let by_day: [f32; 3] =
        core::array::from_fn(|i| along[i] * sun.per_day + by_hour_angle[i] * SIDEREAL_PER_DAY);
    let level2 = square(at[0]) + square(at[1]);
    let azimuth = |by: [f32; 3]| (at[1] * by[0] - at[0] * by[1]) / level2;
    let level = root(level2);
    let elevation = |by: [f32; 3]| by[2] / level;
    let hour = 15.0 * RADIAN;
    let variance = |of: &dyn Fn([f32; 3]) -> f32| {
        square(of(by_hour_angle)) * (square(hour * given.time_h) + square(given.longitude_deg * RADIAN))
            + square(of(by_latitude) * given.latitude_deg * RADIAN)
            + square(of(by_day) * given.day)
    };
    (variance(&azimuth), variance(&elevation))
}

/// Growth of the sidereal time beyond a turn, radians per day.
const SIDEREAL_PER_DAY: f32 = 0.065_709_85 / 24.0 * core::f32::consts::TAU;

fn square(x: f32) -> f32 {
    x * x
}

/// Square root, 0 to 0.2 % too large: micromath's (up to 6.1 % off) after one step of Heron's method, sufficient for
/// values known to a few percent (`docs/decisions/0010-micromath.md`). The root of 0 is 4e-20.
fn root(x: f32) -> f32 {
    let F32(near) = F32(x).sqrt();
    0.5 * (near + x / near)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_at_most_two_thousandths_too_large() {
        let (mut raw, mut least, mut most) = (0.0_f64, f64::MAX, 0.0_f64);
        for bits in 1.0_f32.to_bits()..4.0_f32.to_bits() {
            let x = f32::from_bits(bits);
            let square = |root: f32| f64::from(root) * f64::from(root) / f64::from(x);
            raw = raw.max(square(F32(x).sqrt().0));
            (least, most) = (least.min(square(root(x))), most.max(square(root(x))));
        }
        // In squares, 6.1 % and 0.2 % double; single precision rounds by 1e-7.
        assert!(raw < 1.061 * 1.061, "{raw}");
        assert!(least > 1.0 - 3e-7 && most < 1.002 * 1.002, "{least} to {most}");
    }

    #[test]
    fn the_ends_of_the_range_stay_what_they_are() {
        assert!(root(0.0) < 1e-19 && root(f32::MIN_POSITIVE) < 1.2e-19);
        assert_eq!(root(f32::INFINITY), f32::INFINITY);
        assert!(root(f32::NAN).is_nan() && root(-1.0).is_nan());
        assert!((root(1e30) / 1e15 - 1.0).abs() < 0.002);
    }

    #[test]
    fn bits_are_frozen() {
        let bits = [0.5_f32, 2.0, 3.0, 1e-6, 12_345.0].map(|x| root(x).to_bits());
        assert_eq!(bits, [1_060_459_862, 1_068_848_470, 1_071_494_876, 981_668_463, 1_121_860_136]);
    }
}
