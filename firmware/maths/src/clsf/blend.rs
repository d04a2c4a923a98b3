//! The 3x3 regions blended bilinearly between their centres, without seams; beyond the outer centres one region
//! applies. Factors of `U`, `U^2`, `U^3` and terms in y are linear in the column's weight: one product each. Terms in x
//! are not: a table holds their blend along x for both region rows, blended along y by one more product.

use super::{
    Coefficient, Error, Frame, REGION_TERMS, REGIONS, RegionCoefficients, TableState,
    format::{CONSTANT_BITS, CUBIC_BITS, HALF_UNIT, LINEAR_BITS, SQUARE_BITS, mix, narrow},
    frame::Band,
    regions::{x_terms, y_terms},
    row::{Factors, linear_mixed, uniform_mixed},
};

const BANDS: usize = REGIONS + 1;

/// Correction blended between region centres. Table cost: about 245 instructions per column and row band (four).
#[derive(Debug)]
pub struct Blend<'t> {
    coefficients: RegionCoefficients,
    frame: Frame,
    rows: [Band; BANDS],
    columns: [Band; BANDS],
    /// Per column: terms in x of the upper region row, the lower's excess (one more bit), and the right's weight.
    table: &'t mut [i32],
    table_band: Option<(usize, usize)>,
}

impl<'t> Blend<'t> {
    /// Table words for this width.
    pub const fn table_words(width: u16) -> usize {
        3 * width as usize
    }

    /// `table` is scratch memory of at least [`Self::table_words`]; fails with [`Error::TableTooSmall`].
    pub fn new(coefficients: RegionCoefficients, frame: Frame, table: &'t mut [i32]) -> Result<Self, Error> {
        let (given, needed) = (table.len(), Self::table_words(frame.width()));
        let table = table.get_mut(..needed).ok_or(Error::TableTooSmall { given, needed })?;
        let (rows, columns) = (frame.rows().bands(), frame.columns().bands());
        Ok(Self { coefficients, frame, rows, columns, table, table_band: None })
    }

    /// Continues with a table in this state of a correction with the same coefficients and frame.
    pub fn resume(
        coefficients: RegionCoefficients,
        frame: Frame,
        table: &'t mut [i32],
        state: TableState,
    ) -> Result<Self, Error> {
        let mut correction = Self::new(coefficients, frame, table)?;
        correction.table_band = state.0;
        Ok(correction)
    }

    /// Present state of the table.
    pub fn table_state(&self) -> TableState {
        TableState(self.table_band)
    }

    /// Corrects row `row` in place; in order the table is built only four times. An error leaves the row untouched.
    pub fn correct_row(&mut self, row: u16, depths: &mut [i16]) -> Result<(), Error> {
        self.frame.check_row(row, depths.len())?;
        let Some(band) = self.rows.iter().find(|band| row < band.pixels.end) else {
            return Err(Error::NoSuchRow { row, height: self.frame.height() });
        };
        if self.table_band != Some((band.before, band.after)) {
            let (upper, lower) = (&self.coefficients[band.before], &self.coefficients[band.after]);
            build_table(self.table, self.frame, &self.columns, upper, lower);
            self.table_band = Some((band.before, band.after));
        }
        let of_lower = band.weight(row);
        let y = self.frame.rows().coordinate(row);
        let (upper, lower) = (&self.coefficients[band.before], &self.coefficients[band.after]);
        let regions: [AtRow; REGIONS] =
            core::array::from_fn(|j| AtRow::of(&upper[j], y).mix(&AtRow::of(&lower[j], y), of_lower));
        let (table, _) = self.table.as_chunks::<3>();
        for band in &self.columns {
            let pixels = usize::from(band.pixels.start)..usize::from(band.pixels.end);
            let (depths, of_columns) = (&mut depths[pixels.clone()], &table[pixels]);
            let left = &regions[band.before];
            if band.is_outer() {
                uniform_mixed(depths, of_columns, of_lower, &left.alone());
            } else {
                let factors = left.toward(&regions[band.after]);
                linear_mixed(depths, of_columns, of_lower, &factors);
            }
        }
        Ok(())
    }
}

type RowOfRegions = [[Coefficient; REGION_TERMS]; REGIONS];

fn build_table(
    table: &mut [i32],
    frame: Frame,
    columns: &[Band; BANDS],
    upper: &RowOfRegions,
    lower: &RowOfRegions,
) {
    let axis = frame.columns();
    let (table, _) = table.as_chunks_mut::<3>();
    for band in columns {
        for column in band.pixels.clone() {
            let (x, of_right) = (axis.coordinate(column), band.weight(column));
            let along_x = |regions: &RowOfRegions| {
                let left = narrow(x_terms(&regions[band.before], x), CONSTANT_BITS);
                mix(left, narrow(x_terms(&regions[band.after], x), CONSTANT_BITS), of_right)
            };
            let (above, below) = (along_x(upper), along_x(lower));
            table[usize::from(column)] = [above + HALF_UNIT, 2 * (below - above), of_right];
        }
    }
}

/// Factors of `U^3`, `U^2`, `U` and 1 in a region column at one row, without terms in x.
#[derive(Clone, Copy)]
struct AtRow {
    cubic: i32,
    square: i32,
    linear: i32,
    constant: i32,
}

impl AtRow {
    fn of(terms: &[Coefficient; REGION_TERMS], y: i32) -> Self {
        Self {
            cubic: terms[9].at(CUBIC_BITS),
            square: terms[8].at(SQUARE_BITS),
            linear: terms[7].at(LINEAR_BITS),
            constant: y_terms(terms, y),
        }
    }

    fn mix(&self, other: &Self, weight: i32) -> Self {
        Self {
            cubic: mix(self.cubic, other.cubic, weight),
            square: mix(self.square, other.square, weight),
            linear: mix(self.linear, other.linear, weight),
            constant: mix(self.constant, other.constant, weight),
        }
    }

    fn alone(&self) -> Factors<1, 1, 1, 1> {
        Factors {
            cubic: [self.cubic],
            square: [self.square],
            linear: [self.linear],
            constant: [self.constant],
        }
    }

    /// Polynomials in the weight of `other`. The difference is doubled, because the product loses a fraction bit; it
    /// stays below 2 * 8 * 2^26, 2 * 8 * 2^25, 2 * 8 * 2^24 and 2 * 24 * 2^23.
    fn toward(&self, other: &Self) -> Factors<2, 2, 2, 2> {
        let pair = |from: i32, to: i32| [from, 2 * (to - from)];
        Factors {
            cubic: pair(self.cubic, other.cubic),
            square: pair(self.square, other.square),
            linear: pair(self.linear, other.linear),
            constant: pair(self.constant, other.constant),
        }
    }
}
