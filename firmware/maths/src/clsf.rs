//! Correction by least squares fit (CLSF) in fixed point, row by row.
//!
//! Depth from defocus maps a flat target through a real lens to a bowl that depends on depth. CLSF corrects depth `U`
//! at column `x`, row `y` by a third-order polynomial fitted to flat targets (Li 2014, eq. 6.11). Forms:
//! | form | terms | seams | table words | instructions per pixel (640-pixel rows; with the tables) |
//! |---|---|---|---|---|
//! | [`Regions`] | 10 in each of 3x3 regions | steps at region borders | `width` | 13.8 |
//! | [`Blend`] | the same, bilinear between region centres | none | `3 width` | 22.1 (23.6) |
//! | [`Full`] | all 20 of third order, one set | none | `3 width` | 23.7 |
//!
//! (Emulated Cortex-M4F, `opt-level = "s"`, fat LTO.) [`RegionFit`] and [`FullFit`] fit the coefficients.
//!
//! Units: `U = (depth - centre) / half_span` ([`DepthScale`]) as Q1.15 in an `i16`; `x` and `y` from -1 (first column,
//! row) to +1 (last). Coefficients are Q2.29 ([`Coefficient`]). [`NO_VALUE`] passes unchanged; a result beyond the
//! scale saturates to a code that [`DepthScale::decode`] also treats as no value.
//!
//! ## Shifts and overflow
//! Positions and depths are Q1.31. A product keeps its upper 32 bits (one `SMMLA` on a Cortex-M4), so each Horner step
//! removes a fraction bit: a third-order factor (`U^3`, `x U^2`, `x^2 y`, ...) has 26, second 25, first 24, constant
//! and result 23. The range of an `i32` doubles per step: 32, 64, 128, 256. With coefficients below 4 and |x|, |y|, |U|
//! at most 1 a partial sum is at most 4 times its number of terms: 4 of 32, 16 of 64, 40 of 128 and 80 of 256. A blend
//! is a convex combination; the difference of two factors, multiplied by a weight, has one more fraction bit and at
//! most twice the value. Truncation costs at most 16 units of 2^-23, a sixteenth of a Q1.15 unit.

mod blend;
mod fit;
mod format;
mod frame;
mod full;
mod regions;
mod row;

pub use blend::Blend;
pub use fit::{Columns, FullFit, RegionFit};
pub use format::{Coefficient, DepthScale, NO_VALUE};
pub use frame::{Error, Frame};
pub use full::{FULL_TERMS, Full, FullCoefficients};
pub use regions::{REGION_TERMS, REGIONS, RegionCoefficients, Regions};

/// Contents of a correction's scratch table; saved between two rows, it need not be rebuilt.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct TableState(Option<(usize, usize)>);

impl TableState {
    /// Empty: the table will be built.
    pub const EMPTY: Self = Self(None);
}
