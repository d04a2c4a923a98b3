//! Streaming fit of CLSF's coefficients to rows of flat targets.
//!
//! Normal equations are integer sums: a term (a product of powers of x, y and U) is rounded to 20 fraction bits, a
//! product has 40, and 2^22 of them fit an `i64`. The order of rows has no effect. Only the final Cholesky solution
//! uses double precision, in software on the board. A subsample suffices: every eighth pixel of every eighth row of 24
//! targets at 640x480 is 115,200 samples. Cost on a Cortex-M4F: 780 instructions a sample for ten terms, 2,090 for
//! twenty; 742,000 (all regions) and 477,000 to solve. Memory: 8 KiB for all regions, 3.4 KiB for the full form.

use nalgebra::{SMatrix, SVector};

use super::{
    Coefficient, Error, FULL_TERMS, Frame, FullCoefficients, NO_VALUE, REGION_TERMS, REGIONS,
    RegionCoefficients,
};

const TERM_BITS: u32 = 20;

/// Capacity of the sums, samples.
const MOST_SAMPLES: u32 = 1 << 22;

/// Below this the samples do not determine the terms: a third of the image gives 6e-3, three depths less than 1e-6.
const LEAST_PIVOT: f64 = 3e-5;

#[derive(Clone, Debug)]
struct Sums<const N: usize> {
    /// Lower triangle with the diagonal.
    matrix: [[i64; N]; N],
    right: [i64; N],
    samples: u32,
}

impl<const N: usize> Sums<N> {
    const fn new() -> Self {
        Self { matrix: [[0; N]; N], right: [0; N], samples: 0 }
    }

    fn add(&mut self, terms: &[i32; N], truth: i32) -> Result<(), Error> {
        if self.samples == MOST_SAMPLES {
            return Err(Error::TooManySamples { most: MOST_SAMPLES });
        }
        self.samples += 1;
        for (i, (row, right)) in self.matrix.iter_mut().zip(&mut self.right).enumerate() {
            let term = i64::from(terms[i]);
            for (sum, other) in row[..=i].iter_mut().zip(terms) {
                *sum += term * i64::from(*other);
            }
            *right += term * i64::from(truth);
        }
        Ok(())
    }

    fn solve(&self) -> Result<[Coefficient; N], Error> {
        let underdetermined = Error::Underdetermined { samples: self.samples, terms: N as u16 };
        if self.samples < N as u32 {
            return Err(underdetermined);
        }
        let unit = 1.0 / (f64::from(1 << TERM_BITS) * f64::from(1 << TERM_BITS) * f64::from(self.samples));
        let entry = |i: usize, j: usize| self.matrix[i.max(j)][i.min(j)] as f64 * unit;
        let matrix = SMatrix::<f64, N, N>::from_fn(entry);
        let right = SVector::<f64, N>::from_fn(|i, _| self.right[i] as f64 * unit);
        let Some(factor) = matrix.cholesky() else { return Err(underdetermined) };
        if (0..N).any(|i| factor.l_dirty()[(i, i)] < LEAST_PIVOT) {
            return Err(underdetermined);
        }
        let solution = factor.solve(&right);
        let mut coefficients = [Coefficient::default(); N];
        for (coefficient, value) in coefficients.iter_mut().zip(&solution) {
            *coefficient = Coefficient::from_f64(*value)?;
        }
        Ok(coefficients)
    }
}

/// `value` (Q1.31, depths widened) with the term's fraction bits, rounded.
fn narrow(q31: i32) -> i32 {
    (q31 >> (31 - TERM_BITS - 1)).wrapping_add(1) >> 1
}

fn times(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b) + (1 << (TERM_BITS - 1))) >> TERM_BITS) as i32
}

fn powers(q31: i32) -> [i32; 4] {
    let v = narrow(q31);
    let square = times(v, v);
    [1 << TERM_BITS, v, square, times(square, v)]
}

fn widen(code: i16) -> i32 {
    i32::from(code) << 16
}

/// Columns of a row's samples: every `step`th from `first`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Columns {
    /// First column of the samples.
    pub first: u16,
    /// Column step, at least 1.
    pub step: u16,
}

impl Columns {
    /// Every column of the row.
    pub const ALL: Self = Self { first: 0, step: 1 };

    fn check(self, frame: Frame, row: u16, pixels: usize) -> Result<(), Error> {
        if row >= frame.height() {
            return Err(Error::NoSuchRow { row, height: frame.height() });
        }
        let last = usize::from(self.first) + pixels.saturating_sub(1) * usize::from(self.step);
        if self.step == 0 || last >= usize::from(frame.width()) {
            return Err(Error::RowLength { pixels, width: frame.width() });
        }
        Ok(())
    }

    /// Columns with their depths, within the frame after [`Self::check`].
    fn zip(self, depths: &[i16]) -> impl Iterator<Item = (u16, i16)> {
        let columns =
            depths.iter().enumerate().map(move |(i, depth)| (self.first + i as u16 * self.step, *depth));
        columns.filter(|(_, depth)| *depth != NO_VALUE)
    }
}

/// Fit of ten terms in each of 3x3 regions, also for a blend.
#[derive(Clone, Debug)]
pub struct RegionFit {
    frame: Frame,
    sums: [[Sums<REGION_TERMS>; REGIONS]; REGIONS],
}

impl RegionFit {
    /// Fit without samples.
    pub const fn new(frame: Frame) -> Self {
        Self { frame, sums: [const { [const { Sums::new() }; REGIONS] }; REGIONS] }
    }

    /// Adds pixels of a flat target at `truth`, codes of one [`DepthScale`](super::DepthScale), skipping [`NO_VALUE`].
    pub fn add_row(&mut self, row: u16, columns: Columns, depths: &[i16], truth: i16) -> Result<(), Error> {
        columns.check(self.frame, row, depths.len())?;
        let (rows, across) = (self.frame.rows(), self.frame.columns());
        let y = powers(rows.coordinate(row));
        let truth = narrow(widen(truth));
        let regions = &mut self.sums[rows.region_of(row)];
        for (column, depth) in columns.zip(depths) {
            let (x, u) = (powers(across.coordinate(column)), powers(widen(depth)));
            let terms = [x[0], x[1], x[2], x[3], y[1], y[2], y[3], u[1], u[2], u[3]];
            regions[across.region_of(column)].add(&terms, truth)?;
        }
        Ok(())
    }

    /// The coefficients. [`Error::Underdetermined`]: too few depths (below four) or pixels for a region's terms.
    pub fn solve(&self) -> Result<RegionCoefficients, Error> {
        let mut coefficients = RegionCoefficients::default();
        for (coefficients, sums) in coefficients.as_flattened_mut().iter_mut().zip(self.sums.as_flattened()) {
            *coefficients = sums.solve()?;
        }
        Ok(coefficients)
    }
}

/// Fit of all twenty terms for the whole image.
#[derive(Clone, Debug)]
pub struct FullFit {
    frame: Frame,
    sums: Sums<FULL_TERMS>,
}

impl FullFit {
    /// Fit without samples.
    pub const fn new(frame: Frame) -> Self {
        Self { frame, sums: Sums::new() }
    }

    /// As [`RegionFit::add_row`].
    pub fn add_row(&mut self, row: u16, columns: Columns, depths: &[i16], truth: i16) -> Result<(), Error> {
        columns.check(self.frame, row, depths.len())?;
        let y = powers(self.frame.rows().coordinate(row));
        let truth = narrow(widen(truth));
        for (column, depth) in columns.zip(depths) {
            let (x, u) = (powers(self.frame.columns().coordinate(column)), powers(widen(depth)));
            let (xy, xu, yu) = (times(x[1], y[1]), times(x[1], u[1]), times(y[1], u[1]));
            // In the order of FULL_TERMS.
            let terms = [
                x[0],
                x[1],
                x[2],
                x[3],
                y[1],
                xy,
                times(x[2], y[1]),
                y[2],
                times(x[1], y[2]),
                y[3],
                u[1],
                xu,
                times(x[2], u[1]),
                yu,
                times(xy, u[1]),
                times(y[2], u[1]),
                u[2],
                times(x[1], u[2]),
                times(y[1], u[2]),
                u[3],
            ];
            self.sums.add(&terms, truth)?;
        }
        Ok(())
    }

    /// As [`RegionFit::solve`].
    pub fn solve(&self) -> Result<FullCoefficients, Error> {
        self.sums.solve()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_samples_fill_the_sums_without_overflow_and_one_more_is_refused() {
        const LARGEST: i64 = 1 << TERM_BITS;
        for sign in [1, -1] {
            let mut sums = Sums::<1>::new();
            let before = MOST_SAMPLES - 1;
            sums.samples = before;
            sums.matrix[0][0] = i64::from(before) * LARGEST * LARGEST;
            sums.right[0] = sign * i64::from(before) * LARGEST * LARGEST;
            let (term, truth) = (LARGEST as i32, (sign * LARGEST) as i32);
            assert_eq!(sums.add(&[term], truth), Ok(()));
            assert_eq!(sums.add(&[term], truth), Err(Error::TooManySamples { most: 4_194_304 }));
            assert_eq!(sums.solve().map(|[mean]| mean.to_bits()), Ok(sign as i32 * (1 << 29)));
        }
    }
}
