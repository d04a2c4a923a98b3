//! Medians of square windows by minimum and maximum alone, and their depth.
//!
//! 3x3 by sorted columns (18 exchanges of two), larger ones by forgetting extremes. Cost: 30 operations per vector for 3x3,
//! about 300 for 5x5 and 1,100 for 7x7.

use super::lanes::Lanes;
use super::{Plane, dispatch};
use crate::run::DepthOfAlpha;

dispatch! {
    /// Median over `rows` (as many as the window is wide) and as many columns, and its depth in mm, for `width` columns.
    fn median_row(rows: &[&[f32]], depth_of: DepthOfAlpha, output: &mut [f32], width: usize) = median_generic
}

#[inline(always)]
fn median_generic<L: Lanes>(rows: &[&[f32]], depth_of: DepthOfAlpha, output: &mut [f32], width: usize) {
    assert!(rows.iter().chain([&&*output]).all(|row| width + Plane::PADDING <= row.len()));
    let [c1, c3, c5, c7] = depth_of.linearisation();
    let [c1, c3, c5, c7] = [L::splat(c1), L::splat(c3), L::splat(c5), L::splat(c7)];
    let [focal, squared, offset, slope] = depth_of.coefficients();
    let [focal, squared, offset, slope] =
        [L::splat(focal), L::splat(squared), L::splat(offset), L::splat(slope)];
    for x in (0..width).step_by(L::N) {
        // SAFETY: x < width and rows are at least width + PADDING long; at most N + 2 <= 32 numbers are read at x.
        unsafe {
            let alpha = match rows.len() {
                1 => L::load(rows[0].as_ptr().add(x)),
                3 => median_of_nine([
                    L::taps(rows[0].as_ptr().add(x)),
                    L::taps(rows[1].as_ptr().add(x)),
                    L::taps(rows[2].as_ptr().add(x)),
                ]),
                5 => median_of_many::<L, 25, 14>(window_values::<L, 25>(rows, x)),
                7 => median_of_many::<L, 49, 26>(window_values::<L, 49>(rows, x)),
                // `check` lets no other window through.
                n => unreachable!("median window {n}"),
            };
            let square = alpha.mul(alpha);
            let factor = c7.mul_add(square, c5).mul_add(square, c3).mul_add(square, c1);
            let alpha = alpha.mul(factor);
            let depth = focal.add(squared.div(slope.mul_add(alpha, offset)));
            depth.store(output.as_mut_ptr().add(x));
        }
    }
}

/// The `COUNT` values of the square windows that begin at column `x`.
///
/// # Safety
/// `N` plus the number of rows must be readable at `x` in every row.
#[inline(always)]
unsafe fn window_values<L: Lanes, const COUNT: usize>(rows: &[&[f32]], x: usize) -> [L; COUNT] {
    let side = rows.len();
    let mut values = [L::splat(0.0); COUNT];
    for i in 0..COUNT {
        // SAFETY: the caller's promise.
        values[i] = unsafe { L::load(rows[i / side].as_ptr().add(x + i % side)) };
    }
    values
}

#[inline(always)]
fn ordered<L: Lanes>(a: L, b: L) -> [L; 2] {
    [a.min(b), a.max(b)]
}

#[inline(always)]
fn ordered_three<L: Lanes>([a, b, c]: [L; 3]) -> [L; 3] {
    let [a, b] = ordered(a, b);
    let [b, c] = ordered(b, c);
    let [a, b] = ordered(a, b);
    [a, b, c]
}

/// Median of 3x3: of the columns' smallest the largest, of their medians the median, of their largest the smallest.
#[inline(always)]
fn median_of_nine<L: Lanes>(rows: [[L; 3]; 3]) -> L {
    let mut columns = rows;
    for x in 0..3 {
        columns[x] = ordered_three([rows[0][x], rows[1][x], rows[2][x]]);
    }
    let low = columns[0][0].max(columns[1][0]).max(columns[2][0]);
    let [_, middle, _] = ordered_three([columns[0][1], columns[1][1], columns[2][1]]);
    let high = columns[0][2].min(columns[1][2]).min(columns[2][2]);
    let [_, median, _] = ordered_three([low, middle, high]);
    median
}

/// Median of `COUNT` values by forgetting: of any `KEPT = COUNT / 2 + 2` values neither the smallest nor the largest can
/// be the median, so they make room for the next one.
#[inline(always)]
fn median_of_many<L: Lanes, const COUNT: usize, const KEPT: usize>(values: [L; COUNT]) -> L {
    let mut kept = [values[0]; KEPT];
    kept.copy_from_slice(&values[..KEPT]);
    let mut n = KEPT;
    for next in KEPT..=COUNT {
        // Smallest to the front, largest to the back.
        for i in 0..n / 2 {
            [kept[i], kept[n - 1 - i]] = ordered(kept[i], kept[n - 1 - i]);
        }
        for i in 1..n.div_ceil(2) {
            [kept[0], kept[i]] = ordered(kept[0], kept[i]);
        }
        for i in n / 2..n - 1 {
            [kept[i], kept[n - 1]] = ordered(kept[i], kept[n - 1]);
        }
        if next < COUNT {
            // The new value replaces the smallest; the largest is forgotten by counting one less.
            kept[0] = values[next];
            n -= 1;
        } else {
            kept[0] = kept[1];
        }
    }
    kept[0]
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Portable;
    use super::*;

    fn sorted_median(values: &[f32]) -> f32 {
        let mut sorted = values.to_vec();
        sorted.sort_by(f32::total_cmp);
        sorted[sorted.len() / 2]
    }

    #[test]
    fn medians_are_those_of_sorting() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Few distinct values, so that ties occur.
            ((state >> 40) % 50) as f32
        };
        for _ in 0..500 {
            let values: Vec<f32> = (0..49).map(|_| random()).collect();
            let lanes: Vec<Portable> = values.iter().map(|v| Portable::splat(*v)).collect();
            let nine = median_of_nine([0, 3, 6].map(|i| [lanes[i], lanes[i + 1], lanes[i + 2]]));
            assert_eq!(nine.to_array()[0], sorted_median(&values[..9]));
            let many = median_of_many::<Portable, 25, 14>(lanes[..25].try_into().unwrap());
            assert_eq!(many.to_array()[0], sorted_median(&values[..25]));
            let many = median_of_many::<Portable, 49, 26>(lanes[..].try_into().unwrap());
            assert_eq!(many.to_array()[0], sorted_median(&values));
        }
    }
}
