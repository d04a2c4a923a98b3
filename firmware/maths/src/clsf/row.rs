//! Inner loops: the cubic in `U` with three kinds of factors along the row. Each is one pass, because a Cortex-M4 loads
//! each value beyond 13 registers. Positions come from a table, because a running sum needs two registers more.

use super::{
    NO_VALUE,
    format::{horner, step},
};

/// Factors of `U^3`, `U^2`, `U` and 1 as polynomials in the position; index = power, each with one more fraction bit.
pub(super) struct Factors<const CUBIC: usize, const SQUARE: usize, const LINEAR: usize, const CONSTANT: usize>
{
    pub(super) cubic: [i32; CUBIC],
    pub(super) square: [i32; SQUARE],
    pub(super) linear: [i32; LINEAR],
    pub(super) constant: [i32; CONSTANT],
}

/// Constant factors along the segment; a table adds the column's share.
#[inline(never)]
pub(super) fn uniform(depths: &mut [i16], of_columns: &[i32], factors: &Factors<1, 1, 1, 1>) {
    for_each_pixel(depths, of_columns, |depth, of_column| {
        if *depth != NO_VALUE {
            let constant = factors.constant[0] + of_column;
            *depth = horner(*depth, factors.cubic[0], factors.square[0], factors.linear[0], constant);
        }
    });
}

/// [`uniform`] with three words per column: a value, one added in proportion to `weight`, and one unused.
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

/// [`uniform_mixed`] with factors linear in the table's third word.
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

/// Factors as polynomials in the table's first word; the others add to the factor of `U` and the constant.
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

/// Four pixels per turn, because size optimisation does not unroll: counters are paid once.
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
