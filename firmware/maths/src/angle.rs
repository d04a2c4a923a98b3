//! Angles as 32-bit fractions of a turn: they wrap automatically and resolve 8.4e-8 deg (an `f32` of 25 years in days
//! errs by 3.6 deg). Sine and cosine use exactly rounded single precision: all processors give the same bits.

use core::f32::consts::PI;

/// An angle; 2^32 units are a full turn.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct BinaryAngle(u32);

const RADIANS: f32 = PI / 2_147_483_648.0;

impl BinaryAngle {
    /// Angle from these units.
    pub const fn from_units(units: u32) -> Self {
        Self(units)
    }

    /// Angle in units of 2^-32 turns.
    pub const fn units(self) -> u32 {
        self.0
    }

    /// Nearest angle to whole 1e-7 deg, the usual integer form of latitude and longitude.
    pub const fn from_degrees_e7(degrees_e7: i32) -> Self {
        const TURN_E7: i64 = 3_600_000_000;
        Self((((degrees_e7 as i64) << 32) + TURN_E7 / 2).div_euclid(TURN_E7) as u32)
    }

    /// Nearest angle to `degrees`; 0 if not finite. Inaccurate beyond a turn.
    pub fn from_degrees(degrees: f32) -> Self {
        Self::from_radians(degrees * (PI / 180.0))
    }

    /// Nearest angle to `radians`; 0 if not finite. Best below one radian.
    pub fn from_radians(radians: f32) -> Self {
        // Float conversion saturates; via i64 it wraps as an angle must.
        Self((radians * (1.0 / RADIANS)) as i64 as u32)
    }

    /// In degrees, -180 to 180.
    pub fn to_degrees(self) -> f32 {
        self.0 as i32 as f32 * (RADIANS * (180.0 / PI))
    }

    /// The sum, modulo a turn.
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }

    /// Twice the angle, modulo a turn.
    pub const fn doubled(self) -> Self {
        Self(self.0.wrapping_mul(2))
    }

    /// Sine and cosine, to 1.2e-7.
    pub fn sin_cos(self) -> (f32, f32) {
        // Exact reduction to the nearest quarter turn.
        let quarters = self.0.wrapping_add(1 << 29) >> 30;
        let x = self.0.wrapping_sub(quarters << 30) as i32 as f32 * RADIANS;
        let x2 = x * x;
        // Taylor: truncation below 2e-9 for |x| <= pi / 4.
        let sin =
            x - x * x2 * (1.0 / 6.0 - x2 * (1.0 / 120.0 - x2 * (1.0 / 5040.0 - x2 * (1.0 / 362_880.0))));
        let cos = 1.0
            - x2 * (0.5
                - x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0 - x2 * (1.0 / 40_320.0 - x2 * (1.0 / 3_628_800.0)))));
        match quarters % 4 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

/// `atan2(y, x)` in degrees, -180 to 180; 0 for two zeros.
pub(crate) fn atan2_degrees(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x) * (180.0 / PI)
}

/// `sqrt(x^2 + y^2)` of numbers near 1, without overflow.
pub(crate) fn length(x: f32, y: f32) -> f32 {
    libm::sqrtf(x * x + y * y)
}
