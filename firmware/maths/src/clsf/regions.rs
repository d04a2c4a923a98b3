//! Ten terms in each of 3x3 regions (Li 2014, eq. 6.11 and section 6.4).

use super::{
    Coefficient, Error, Frame, TableState,
    format::{CONSTANT_BITS, CUBIC_BITS, HALF_UNIT, LINEAR_BITS, SQUARE_BITS, multiply, narrow, step},
    row::{Factors, uniform},
};

/// Regions per side of the image.
pub const REGIONS: usize = 3;

/// Terms of a region in this order: 1, x, x^2, x^3, y, y^2, y^3, U, U^2, U^3.
pub const REGION_TERMS: usize = 10;

/// Coefficients as `[region row][region column][term]`.
pub type RegionCoefficients = [[[Coefficient; REGION_TERMS]; REGIONS]; REGIONS];

/// Correction per region. Cost: a cubic in `U` per pixel; about 50 instructions a column for each region row's table.
#[derive(Debug)]
pub struct Regions<'t> {
    coefficients: RegionCoefficients,
    frame: Frame,
    /// Per column: terms in x and the constant, for the region row `table_row`.
    table: &'t mut [i32],
    table_row: Option<usize>,
}

impl<'t> Regions<'t> {
    /// Table words for this width.
    pub const fn table_words(width: u16) -> usize {
        width as usize
    }

    /// `table` is scratch memory of at least [`Self::table_words`]; fails with [`Error::TableTooSmall`].
    pub fn new(coefficients: RegionCoefficients, frame: Frame, table: &'t mut [i32]) -> Result<Self, Error> {
        let (given, needed) = (table.len(), Self::table_words(frame.width()));
        let table = table.get_mut(..needed).ok_or(Error::TableTooSmall { given, needed })?;
        Ok(Self { coefficients, frame, table, table_row: None })
    }

    /// Continues with a table in this state of a correction with the same coefficients and frame.
    pub fn resume(
        coefficients: RegionCoefficients,
        frame: Frame,
        table: &'t mut [i32],
        state: TableState,
    ) -> Result<Self, Error> {
        let mut correction = Self::new(coefficients, frame, table)?;
        correction.table_row = state.0.map(|(row, _)| row);
        Ok(correction)
    }

    /// Present state of the table.
    pub fn table_state(&self) -> TableState {
        TableState(self.table_row.map(|row| (row, row)))
    }

    /// Corrects row `row` in place; in order the table is built only three times. An error leaves the row untouched.
    pub fn correct_row(&mut self, row: u16, depths: &mut [i16]) -> Result<(), Error> {
        self.frame.check_row(row, depths.len())?;
        let region_row = self.frame.rows().region_of(row);
        if self.table_row != Some(region_row) {
            self.build_table(region_row);
        }
        let y = self.frame.rows().coordinate(row);
        for (region_column, terms) in self.coefficients[region_row].iter().enumerate() {
            let columns = self.frame.columns().region(region_column);
            let columns = usize::from(columns.start)..usize::from(columns.end);
            let factors = Factors {
                cubic: [terms[9].at(CUBIC_BITS)],
                square: [terms[8].at(SQUARE_BITS)],
                linear: [terms[7].at(LINEAR_BITS)],
                constant: [y_terms(terms, y)],
            };
            uniform(&mut depths[columns.clone()], &self.table[columns], &factors);
        }
        Ok(())
    }

    fn build_table(&mut self, region_row: usize) {
        let columns = self.frame.columns();
        for (region_column, terms) in self.coefficients[region_row].iter().enumerate() {
            for column in columns.region(region_column) {
                let sum = x_terms(terms, columns.coordinate(column));
                self.table[usize::from(column)] = narrow(sum, CONSTANT_BITS) + HALF_UNIT;
            }
        }
        self.table_row = Some(region_row);
    }
}

/// `c0 + c1 x + c2 x^2 + c3 x^3` as Q.29, below 16.
pub(super) fn x_terms(terms: &[Coefficient; REGION_TERMS], x: i32) -> i64 {
    let sum = terms[2].wide() + multiply(terms[3].wide(), x);
    let sum = terms[1].wide() + multiply(sum, x);
    terms[0].wide() + multiply(sum, x)
}

/// `c4 y + c5 y^2 + c6 y^3` with the constant's fraction bits.
pub(super) fn y_terms(terms: &[Coefficient; REGION_TERMS], y: i32) -> i32 {
    let sum = step(terms[5].at(SQUARE_BITS), terms[6].at(CUBIC_BITS), y);
    step(0, step(terms[4].at(LINEAR_BITS), sum, y), y)
}
