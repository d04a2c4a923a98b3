//! Number formats: depth Q1.15, coefficients Q2.29, the Horner step.

use super::Error;

/// Code of a pixel without depth; a correction keeps it.
pub const NO_VALUE: i16 = i16::MIN;

/// Largest code. Depths beyond the scale saturate to `i16::MAX` or [`NO_VALUE`]; neither end is a measurement.
const LARGEST: f32 = 32766.0;

/// Linear map between mm and normalised depth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DepthScale {
    centre_mm: f32,
    half_span_mm: f32,
}

impl DepthScale {
    /// Factor on half the working range, so that a distorted depth still fits the scale.
    pub const MARGIN: f32 = 1.3;

    /// The scale for a working range, ends in mm in either order; [`Error::EmptyRange`] unless finite and different.
    pub fn for_range(one_end_mm: f32, other_end_mm: f32) -> Result<Self, Error> {
        let half = (one_end_mm - other_end_mm) / 2.0;
        let half = if half < 0.0 { -half } else { half };
        let scale = Self { centre_mm: (one_end_mm + other_end_mm) / 2.0, half_span_mm: half * Self::MARGIN };
        if scale.half_span_mm > 0.0 && scale.half_span_mm < f32::INFINITY && scale.centre_mm.is_finite() {
            Ok(scale)
        } else {
            Err(Error::EmptyRange { one_end_mm, other_end_mm })
        }
    }

    /// Depth of code 0, mm.
    pub fn centre_mm(self) -> f32 {
        self.centre_mm
    }

    /// Depth difference of a normalised unit, mm.
    pub fn half_span_mm(self) -> f32 {
        self.half_span_mm
    }

    /// Encodes mm as Q1.15; NaN and values beyond the scale give [`NO_VALUE`].
    pub fn encode(self, depth_mm: f32) -> i16 {
        let code = (depth_mm - self.centre_mm) / self.half_span_mm * 32768.0;
        let rounded = if code < 0.0 { code - 0.5 } else { code + 0.5 };
        // NaN fails this comparison.
        if rounded > -LARGEST - 1.0 && rounded < LARGEST + 1.0 { rounded as i16 } else { NO_VALUE }
    }

    /// Decodes Q1.15 to mm; NaN for [`NO_VALUE`] and saturated values.
    pub fn decode(self, code: i16) -> f32 {
        if code == NO_VALUE || code == i16::MAX {
            f32::NAN
        } else {
            self.centre_mm + f32::from(code) * (1.0 / 32768.0) * self.half_span_mm
        }
    }
}

/// Polynomial coefficient, Q2.29: below 4 in steps of 1.9e-9.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Coefficient(i32);

impl Coefficient {
    const FRACTION_BITS: u32 = 29;
    const SCALE: f64 = (1_u32 << Self::FRACTION_BITS) as f64;

    /// The nearest coefficient; [`Error::CoefficientTooLarge`] unless the magnitude is below 4.
    pub fn from_f64(value: f64) -> Result<Self, Error> {
        let scaled = value * Self::SCALE;
        let rounded = if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 };
        if rounded > -2_147_483_648.0 && rounded < 2_147_483_648.0 {
            Ok(Self(rounded as i32))
        } else {
            Err(Error::CoefficientTooLarge { value })
        }
    }

    /// The coefficient with these bits; [`Error::CoefficientTooLarge`] for `i32::MIN` (-4).
    pub fn from_bits(bits: i32) -> Result<Self, Error> {
        if bits == i32::MIN { Err(Error::CoefficientTooLarge { value: -4.0 }) } else { Ok(Self(bits)) }
    }

    /// Bits of the coefficient in Q2.29.
    pub fn to_bits(self) -> i32 {
        self.0
    }

    /// Bits with `fraction_bits` (at most 29), truncated.
    pub(super) fn at(self, fraction_bits: u32) -> i32 {
        self.0 >> (Self::FRACTION_BITS - fraction_bits)
    }

    /// [`Self::at`] in 64 bits, for sums rounded once.
    pub(super) fn wide(self) -> i64 {
        i64::from(self.0)
    }
}

/// Fraction bits of the factors of `U^3`, `U^2`, `U` and of the constant and the result: each Horner step removes one.
pub(super) const CUBIC_BITS: u32 = 26;
pub(super) const SQUARE_BITS: u32 = CUBIC_BITS - 1;
pub(super) const LINEAR_BITS: u32 = CUBIC_BITS - 2;
pub(super) const CONSTANT_BITS: u32 = CUBIC_BITS - 3;
const RESULT_SHIFT: u32 = CONSTANT_BITS - 15;
/// Half a Q1.15 unit, added to the constant so that truncation rounds.
pub(super) const HALF_UNIT: i32 = 1 << (RESULT_SHIFT - 1);

/// `addend + a * b` with the product's upper 32 bits: `b` in Q1.31 removes one fraction bit of `a`.
#[inline(always)]
pub(super) fn step(addend: i32, a: i32, b: i32) -> i32 {
    addend + ((i64::from(a) * i64::from(b)) >> 32) as i32
}

/// `a * b` for `a` in Q.29 below 16 and `b` in Q1.31, rounded, in 64 bits.
pub(super) fn multiply(a: i64, q31: i32) -> i64 {
    // 2^33 times 2^30: the last bit of b is dropped to make room.
    (a * i64::from(q31 >> 1) + (1 << 29)) >> 30
}

/// A Q.29 sum at fewer fraction bits, rounded; the caller guarantees that it fits.
pub(super) fn narrow(sum_q29: i64, fraction_bits: u32) -> i32 {
    let shift = Coefficient::FRACTION_BITS - fraction_bits;
    ((sum_q29 + (1 << (shift - 1))) >> shift) as i32
}

/// Moves `from` towards `to` by a weight in Q1.31, >= 0; the difference may take 33 bits, the product 64.
#[inline(always)]
pub(super) fn mix(from: i32, to: i32, weight: i32) -> i32 {
    from + (((i64::from(to) - i64::from(from)) * i64::from(weight)) >> 31) as i32
}

/// `constant + U (linear + U (square + U cubic))` as Q1.15.
#[inline(always)]
pub(super) fn horner(depth: i16, cubic: i32, square: i32, linear: i32, constant: i32) -> i16 {
    let u = i32::from(depth) << 16;
    let sum = step(constant, step(linear, step(square, cubic, u), u), u);
    (sum >> RESULT_SHIFT).clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
}
