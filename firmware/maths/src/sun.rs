//! Sun position: PSA+ (Blanco et al. 2020) with binary phases and single precision.
//!
//! Mean longitude, mean anomaly, node and sidereal time are 64-bit phases: seconds times a rate in 2^-64 turns per
//! second, exact modulo a turn. Small corrections are in single precision. The sun's vector is rotated from ecliptic to
//! equator, by sidereal time, and to the horizon, without right ascension, declination, branch or division. Accuracy:
//! 1e-4 deg in elevation and (below 89 deg) 1e-3 deg in azimuth relative to double precision; PSA+ is within 0.009 /
//! 0.05 deg of NREL's SPA for 2014 to 2040. No refraction. Cost: 725 instructions, angles included.

use crate::angle::{BinaryAngle, atan2_degrees, length};

/// 2000-01-01 12:00 UT as Unix time.
const EPOCH: i64 = 946_728_000;

/// Phase that grows linearly with time, in 2^-64 turns.
struct Phase {
    at_epoch: u64,
    per_second: u64,
}

/// `turns` in 2^-64 turns, modulo one turn; negative ones wrap.
const fn turns(turns: f64) -> u64 {
    // 2^64 = 2^32 * 2^32: the integer part is removed before it could be rounded.
    let whole = turns as i64 as f64;
    ((turns - whole) * 18_446_744_073_709_551_616.0) as i128 as u64
}

const TAU: f64 = core::f64::consts::TAU;
const DAY: f64 = 86_400.0;

impl Phase {
    /// `at_epoch + per_day * n` in radians, n in days since the epoch.
    const fn radians(at_epoch: f64, per_day: f64) -> Self {
        Self { at_epoch: turns(at_epoch / TAU), per_second: turns(per_day / TAU / DAY) }
    }

    fn at(&self, seconds: i64) -> BinaryAngle {
        let phase = self.at_epoch.wrapping_add((seconds as u64).wrapping_mul(self.per_second));
        BinaryAngle::from_units((phase >> 32) as u32)
    }
}

/// Longitude of the moon's node.
const NODE: Phase = Phase::radians(2.267_127_827, -9.300_339_267e-4);
/// Mean longitude of the sun.
const LONGITUDE: Phase = Phase::radians(4.895_036_035, 1.720_279_602e-2);
/// Mean anomaly of the sun.
const ANOMALY: Phase = Phase::radians(6.239_468_336, 1.720_200_135e-2);
/// Sidereal time at Greenwich: `(6.697 + 0.0657 n + h) / 24` turns, where the hour `h` of UT is `24 (n + 1/2)`.
const SIDEREAL: Phase = Phase {
    at_epoch: turns(6.697_096_103 / 24.0 + 0.5),
    per_second: turns((1.0 + 6.570_984_737e-2 / 24.0) / DAY),
};

/// Horizontal parallax, radians (0.00244 deg).
const PARALLAX: f32 = 4.2586e-5;

/// Place on the earth, without height.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Place {
    /// Latitude, north positive.
    pub latitude: BinaryAngle,
    /// Longitude, east positive.
    pub longitude: BinaryAngle,
}

/// Unit vector to the sun.
#[derive(Clone, Copy, PartialEq, Debug)]
#[allow(missing_docs, reason = "names and types describe these fields")]
pub struct Sun {
    pub east: f32,
    pub north: f32,
    pub up: f32,
}

/// Equatorial position of the sun, also for error propagation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Equatorial {
    /// Components along the vernal equinox, 90 deg east of it, and the pole.
    pub(crate) vector: [f32; 3],
    /// Derivative by the ecliptic longitude.
    pub(crate) derivative: [f32; 3],
    /// Growth of the longitude per day, radians.
    pub(crate) per_day: f32,
    pub(crate) sidereal: BinaryAngle,
}

#[allow(clippy::excessive_precision)] // The published digits; the compiler rounds them.
pub(crate) fn equatorial(unix_seconds: i64) -> Equatorial {
    let seconds = unix_seconds.wrapping_sub(EPOCH);
    let (sin_node, cos_node) = NODE.at(seconds).sin_cos();
    let anomaly = ANOMALY.at(seconds);
    let (sin_g, cos_g) = anomaly.sin_cos();
    let (sin_2g, _) = anomaly.doubled().sin_cos();
    let small =
        3.338_320_972e-2 * sin_g + 3.497_596_876e-4 * sin_2g - 1.544_353_226e-4 - 8.689_729_36e-6 * sin_node;
    let (sin_l, cos_l) = LONGITUDE.at(seconds).plus(BinaryAngle::from_radians(small)).sin_cos();
    let days = seconds as f32 * (1.0 / DAY as f32);
    let obliquity = 4.090_904_909e-1 - 6.213_605_399e-9 * days + 4.418_094_944e-5 * cos_node;
    let (sin_e, cos_e) = BinaryAngle::from_radians(obliquity).sin_cos();
    Equatorial {
        vector: [cos_l, cos_e * sin_l, sin_e * sin_l],
        derivative: [-sin_l, cos_e * cos_l, sin_e * cos_l],
        per_day: 1.720_279_6e-2 + 3.338_321e-2 * 1.720_200_1e-2 * cos_g,
        sidereal: SIDEREAL.at(seconds),
    }
}

/// Equatorial vector in the horizon: east, north, up.
pub(crate) fn horizontal(vector: [f32; 3], sidereal: BinaryAngle, place: &Place) -> [f32; 3] {
    let (sin_t, cos_t) = sidereal.plus(place.longitude).sin_cos();
    let (sin_lat, cos_lat) = place.latitude.sin_cos();
    let [x, y, z] = vector;
    // Towards the meridian, and west of it.
    let (meridian, west) = (x * cos_t + y * sin_t, x * sin_t - y * cos_t);
    [-west, z * cos_lat - meridian * sin_lat, z * sin_lat + meridian * cos_lat]
}

impl Sun {
    /// The sun at a time (Unix time, UT) and place.
    pub fn at(unix_seconds: i64, place: &Place) -> Self {
        let equatorial = equatorial(unix_seconds);
        let [east, north, up] = horizontal(equatorial.vector, equatorial.sidereal, place);
        Self { east, north, up }
    }

    /// Elevation with parallax, without refraction.
    pub fn elevation_deg(&self) -> f32 {
        let level = length(self.east, self.north);
        atan2_degrees(self.up, level) - PARALLAX * (180.0 / core::f32::consts::PI) * level
    }

    /// Azimuth clockwise from north, 0 to below 360.
    pub fn azimuth_deg(&self) -> f32 {
        let azimuth = atan2_degrees(self.east, self.north);
        if azimuth < 0.0 { azimuth + 360.0 } else { azimuth }
    }
}
