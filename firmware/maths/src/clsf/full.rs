//! One polynomial with all twenty third-order terms in x, y and U. Seamless, with the cross terms that ten terms lack
//! (a bowl that changes with `U` is `U x^2`). In a given row the factor of each power of `U` is a polynomial in x,
//! evaluated by Horner's rule: seven products a pixel.

use super::{
    Coefficient, Error, Frame, TableState,
    format::{CONSTANT_BITS, CUBIC_BITS, HALF_UNIT, LINEAR_BITS, SQUARE_BITS, multiply, narrow, step},
    row::{Factors, polynomial},
};

/// Order: 1, x, x^2, x^3, y, xy, x^2 y, y^2, x y^2, y^3, U, xU, x^2 U, yU, xyU, y^2 U, U^2, xU^2, yU^2, U^3.
pub const FULL_TERMS: usize = 20;

/// Coefficients in the order of [`FULL_TERMS`].
pub type FullCoefficients = [Coefficient; FULL_TERMS];

/// Correction with twenty coefficients.
#[derive(Debug)]
pub struct Full<'t> {
    coefficients: FullCoefficients,
    frame: Frame,
    /// Per column: x, the terms in x and U alone (divided by U), the terms in x alone.
    table: &'t mut [i32],
}

impl<'t> Full<'t> {
    /// Table words for this width.
    pub const fn table_words(width: u16) -> usize {
        3 * width as usize
    }

    /// `table` is scratch memory of at least [`Self::table_words`]; fails with [`Error::TableTooSmall`].
    pub fn new(coefficients: FullCoefficients, frame: Frame, table: &'t mut [i32]) -> Result<Self, Error> {
        let (given, needed) = (table.len(), Self::table_words(frame.width()));
        let table = table.get_mut(..needed).ok_or(Error::TableTooSmall { given, needed })?;
        let (entries, _) = table.as_chunks_mut::<3>();
        for (column, entry) in (0..frame.width()).zip(entries) {
            let x = frame.columns().coordinate(column);
            let linear = horner_in(x, [10, 11, 12].map(|term| coefficients[term]));
            let constant = horner_in(x, [0, 1, 2, 3].map(|term| coefficients[term]));
            *entry = [x, narrow(linear, LINEAR_BITS), narrow(constant, CONSTANT_BITS) + HALF_UNIT];
        }
        Ok(Self { coefficients, frame, table })
    }

    /// Continues with a table in this state of a correction with the same coefficients and frame.
    pub fn resume(
        coefficients: FullCoefficients,
        frame: Frame,
        table: &'t mut [i32],
        state: TableState,
    ) -> Result<Self, Error> {
        if state == TableState::EMPTY {
            return Self::new(coefficients, frame, table);
        }
        let (given, needed) = (table.len(), Self::table_words(frame.width()));
        let table = table.get_mut(..needed).ok_or(Error::TableTooSmall { given, needed })?;
        Ok(Self { coefficients, frame, table })
    }

    /// Present state of the table.
    pub fn table_state(&self) -> TableState {
        TableState(Some((0, 0)))
    }

    /// Corrects row `row` in place; an error leaves it untouched.
    pub fn correct_row(&mut self, row: u16, depths: &mut [i16]) -> Result<(), Error> {
        self.frame.check_row(row, depths.len())?;
        let y = self.frame.rows().coordinate(row);
        polynomial(depths, self.table.as_chunks().0, &along_row(&self.coefficients, y));
        Ok(())
    }
}

/// Polynomial in x with rising powers, Q.29, below 16.
fn horner_in<const N: usize>(x: i32, terms: [Coefficient; N]) -> i64 {
    terms.iter().rev().fold(0, |sum, term| term.wide() + multiply(sum, x))
}

/// Factors of the powers of `U` at `y`, as polynomials in x, without the table's share.
fn along_row(coefficients: &FullCoefficients, y: i32) -> Factors<1, 2, 2, 3> {
    let cubic = |term: usize| coefficients[term].at(CUBIC_BITS);
    let square = |term: usize, rest| step(coefficients[term].at(SQUARE_BITS), rest, y);
    let linear = |term: usize, rest| step(coefficients[term].at(LINEAR_BITS), rest, y);
    // One more factor y.
    let by_y = |rest| step(0, rest, y);
    Factors {
        cubic: [cubic(19)],
        square: [square(16, cubic(18)), cubic(17)],
        linear: [by_y(square(13, cubic(15))), by_y(cubic(14))],
        constant: [by_y(linear(4, square(7, cubic(9)))), by_y(square(5, cubic(8))), by_y(cubic(6))],
    }
}
