//! The inner loops: the cubic in `U`, its factors varying along the row in three ways.
//!
//! Each loop is kept to one pass and few values, because a Cortex-M4 has 13 registers for them and pays an
//! instruction to load each that does not fit. Places along the row come from a table too: a running sum would cost
//! the same addition and two registers more.

use super::{
    NO_VALUE,
    format::{horner, step},
};

/// `U^3`, `U^2` and `U`'s factors and what does not depend on `U`, each a polynomial in the place along the row;
/// index = power, and each power has one fraction bit more than the one before.
pub(super) struct Factors<const CUBIC: usize, const SQUARE: usize, const LINEAR: usize, const CONSTANT: usize>
{
    pub(super) cubic: [i32; CUBIC],
    pub(super) square: [i32; SQUARE],
    pub(super) linear: [i32; LINEAR],
    pub(super) constant: [i32; CONSTANT],
}

/// Factors that are the same along the segment; a table adds what depends on the column.
#[inline(never)]
pub(super) fn uniform(depths: &mut [i16], of_columns: &[i32], factors: &Factors<1, 1, 1, 1>) {
    for_each_pixel(depths, of_columns, |depth, of_column| {
        if *depth != NO_VALUE {
            let constant = factors.constant[0] + of_column;
            *depth = horner(*depth, factors.cubic[0], factors.square[0], factors.linear[0], constant);
        }
    });
}

/// As [`uniform`] with a table of three words per column: a value, what is added in proportion to `weight`, and one not used.
#[inline(never)]
pub(super) fn uniform_mixed(
    depths: &mut [i16],
    of_columns: &[[i32; 3]],
    weight: i32,
    factors: &Factors<1, 1, 1, 1>,
) {
    for_each_pixel(depths, of_columns, |depth, of_column| {
        if *depth != NO_VALUE {
            let constant = step(factors.constant[0] + of_column[0], of_column[1], weight);
            *depth = horner(*depth, factors.cubic[0], factors.square[0], factors.linear[0], constant);
        }
    });
}

/// As [`uniform_mixed`] with factors that are linear in a third word of the table.
#[inline(never)]
pub(super) fn linear_mixed(
    depths: &mut [i16],
    of_columns: &[[i32; 3]],
    weight: i32,
    factors: &Factors<2, 2, 2, 2>,
) {
    for_each_pixel(depths, of_columns, |depth, &[value, excess, place]| {
        if *depth != NO_VALUE {
            let of = |terms: &[i32; 2]| step(terms[0], terms[1], place);
            let constant = step(of(&factors.constant) + value, excess, weight);
            *depth = horner(*depth, of(&factors.cubic), of(&factors.square), of(&factors.linear), constant);
        }
    });
}

/// Factors that are polynomials in the place along the row, which is the table's first word. The second word is
/// added to the factor of `U`, the third to what does not depend on `U`.
#[inline(never)]
pub(super) fn polynomial(depths: &mut [i16], of_columns: &[[i32; 3]], factors: &Factors<1, 2, 2, 3>) {
    for_each_pixel(depths, of_columns, |depth, &[place, linear, constant]| {
        if *depth != NO_VALUE {
            let square = step(factors.square[0], factors.square[1], place);
            let linear = step(factors.linear[0] + linear, factors.linear[1], place);
            let rest = step(factors.constant[1], factors.constant[2], place);
            let constant = step(factors.constant[0] + constant, rest, place);
            *depth = horner(*depth, factors.cubic[0], square, linear, constant);
        }
    });
}

/// Four pixels a turn, spelt out because a compiler that optimises for size does not: a turn's counters are paid
/// once, and the offsets within it are part of the instructions.
#[inline(always)]
fn for_each_pixel<T>(depths: &mut [i16], of_columns: &[T], mut pixel: impl FnMut(&mut i16, &T)) {
    let (fours, rest) = depths.as_chunks_mut::<4>();
    let (of_fours, of_rest) = of_columns.as_chunks::<4>();
    for ([a, b, c, d], [of_a, of_b, of_c, of_d]) in fours.iter_mut().zip(of_fours) {
        pixel(a, of_a);
        pixel(b, of_b);
        pixel(c, of_c);
        pixel(d, of_d);
    }
    rest.iter_mut().zip(of_rest).for_each(|(depth, of_column)| pixel(depth, of_column));
}
