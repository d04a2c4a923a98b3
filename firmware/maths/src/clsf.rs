//! Correction by least squares fit (CLSF) in fixed point, one row at a time.
//!
//! A flat target seen through a real lens comes out of depth from defocus as a bowl that depends on the depth
//! itself. CLSF maps the distorted depth `U` at column `x` and row `y` to the corrected depth by a third-order
//! polynomial fitted to flat targets (Li 2014, eq. 6.11). Three forms:
//!
//! | form | terms | seams | table words | instructions per pixel (640-pixel rows; with the tables) |
//! |---|---|---|---|---|
//! | [`Regions`] | 10 in each of 3x3 regions | steps at region borders | `width` | 13.5 (13.7) |
//! | [`Blend`] | the same, bilinear between region centres | none | `3 width` | 22.1 (23.6) |
//! | [`Full`] | all 20 of third order, one set | none | `3 width` | 22.7 (22.7) |
//!
//! (Counted on an emulated Cortex-M4F, built with `opt-level = "s"` and fat LTO.) [`RegionFit`] and [`FullFit`] find the
//! coefficients from rows of flat targets.
//!
//! Units: depth is normalised to `U = (depth - centre) / half_span` ([`DepthScale`]) and travels as Q1.15 in an
//! `i16`; `x` and `y` run from -1 (first column, row) to +1 (last). Coefficients are Q2.29 ([`Coefficient`]).
//! A pixel without a depth is [`NO_VALUE`] and stays so; a result beyond the scale saturates to a code that
//! [`DepthScale::decode`] takes for no value either.
//!
//! ## Shifts, and why nothing overflows
//! Places and depths are Q1.31; a product keeps its upper 32 bits (one `SMMLA` on a Cortex-M4), so each Horner step
//! takes a fraction bit away: a factor of third order (`U^3`, `x U^2`, `x^2 y`, ...) has 26, of second 25, of first
//! 24, the constant and the result 23. Thus the range of an `i32` doubles from step to step: 32, 64, 128, 256.
//! With every coefficient below 4 and |x|, |y|, |U| <= 1 a partial sum is at most 4 times the number of its terms:
//! 4 of 32, 16 of 64, 40 of 128 and 80 of 256. A blend is a convex combination; the difference of two factors, which
//! is multiplied by a weight, carries one fraction bit more and at most twice the value.
//! Truncation costs at most 16 units of 2^-23, which is a sixteenth of a unit of the Q1.15 result.

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

/// What the scratch table of a correction holds. Kept next to the table by whoever takes the correction apart between two
/// rows (a board that has other work), so that it need not be built again.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct TableState(Option<(usize, usize)>);

impl TableState {
    /// Nothing: the table will be built.
    pub const EMPTY: Self = Self(None);
}
