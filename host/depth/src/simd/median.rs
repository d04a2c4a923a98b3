//! Medians of square windows by minimum and maximum alone, and their depth.
//!
//! First the columns of the window's rows are sorted, once for all windows that share them. The values of one rank in a
//! window's `n` sorted columns make a row. If the rows were sorted too, the value at (i, j) would have at least
//! `(i + 1) (j + 1) - 1` values not above it and `(n - i) (n - j) - 1` not below: only a band along the diagonal can be
//! the median, with as many values above as below (after Paeth 1990, generalised). Selection within each row finds the
//! band; dropping pairs of extremes from its 13 values (5x5) or 29 (7x7) leaves the median. Cost per vector: 24 minima
//! and maxima for 3x3, about 140 for 5x5, about 510 for 7x7.

use super::lanes::Lanes;
use super::{Plane, dispatch};
use crate::depth_of_alpha::DepthOfAlpha;

dispatch! {
    /// Median over `rows` and as many columns, and its depth in mm, for `width` columns. `sorted` has as many rows.
    fn median_row(rows: &[&[f32]], sorted: &mut Plane, depth_of: DepthOfAlpha, output: &mut [f32], width: usize) =
        median_generic
}

#[inline(always)]
fn median_generic<L: Lanes>(
    rows: &[&[f32]],
    sorted: &mut Plane,
    depth_of: DepthOfAlpha,
    output: &mut [f32],
    width: usize,
) {
    assert!(rows.iter().chain([&&*output]).all(|row| width + Plane::PADDING <= row.len()));
    assert!(sorted.rows() >= rows.len() && width + Plane::PADDING <= sorted.stride());
    match rows.len() {
        1 => {
            let to_depth = ToDepth::<L>::new(depth_of);
            for x in (0..width).step_by(L::N) {
                // SAFETY: x < width, and width + PADDING numbers are in each row.
                unsafe { to_depth.of(L::load(rows[0].as_ptr().add(x))).store(output.as_mut_ptr().add(x)) };
            }
        }
        3 => medians::<L, 3>(rows, sorted, depth_of, output, width),
        5 => medians::<L, 5>(rows, sorted, depth_of, output, width),
        7 => medians::<L, 7>(rows, sorted, depth_of, output, width),
        // `check` rejects other windows.
        n => unreachable!("median window {n}"),
    }
}

#[inline(always)]
fn medians<L: Lanes, const SIDE: usize>(
    rows: &[&[f32]],
    sorted: &mut Plane,
    depth_of: DepthOfAlpha,
    output: &mut [f32],
    width: usize,
) {
    let stride = sorted.stride();
    let base = sorted.all_mut().as_mut_ptr();
    // Windows reach SIDE - 1 columns beyond the width, and vectors are loaded in pairs.
    for x in (0..width + 2 * L::N).step_by(L::N) {
        let mut column = [L::splat(0.0); SIDE];
        // SAFETY: x < width + 2 N, so N numbers at x end before width + 3 N <= width + 48 < width + PADDING, which is in
        // each row (`median_generic`).
        unsafe {
            for i in 0..SIDE {
                column[i] = L::load(rows[i].as_ptr().add(x));
            }
            sort(&mut column);
            for i in 0..SIDE {
                column[i].store(base.add(i * stride + x));
            }
        }
    }
    let to_depth = ToDepth::<L>::new(depth_of);
    for x in (0..width).step_by(L::N) {
        let mut ranks = [[L::splat(0.0); SIDE]; SIDE];
        // SAFETY: x < width, so 2 N numbers at x end within what was written above; the output is as long.
        unsafe {
            for i in 0..SIDE {
                ranks[i] = neighbours(base.add(i * stride + x));
            }
            to_depth.of(median_of_sorted(&ranks)).store(output.as_mut_ptr().add(x));
        }
    }
}

/// The vectors at `p`, `p + 1`, ...
///
/// # Safety
/// `2 N` numbers must be readable at `p`.
#[inline(always)]
unsafe fn neighbours<L: Lanes, const COUNT: usize>(p: *const f32) -> [L; COUNT] {
    // SAFETY: the caller's promise; COUNT is at most 7.
    unsafe {
        let [here, next] = [L::load(p), L::load(p.add(L::N))];
        let mut all = [here; COUNT];
        for i in 1..COUNT {
            all[i] = match i {
                1 => L::beside::<1>(p, here, next),
                2 => L::beside::<2>(p, here, next),
                3 => L::beside::<3>(p, here, next),
                4 => L::beside::<4>(p, here, next),
                5 => L::beside::<5>(p, here, next),
                _ => L::beside::<6>(p, here, next),
            };
        }
        all
    }
}

struct ToDepth<L> {
    linearisation: [L; 4],
    focal: L,
    squared: L,
    offset: L,
    slope: L,
}

impl<L: Lanes> ToDepth<L> {
    #[inline(always)]
    fn new(depth_of: DepthOfAlpha) -> Self {
        let [c1, c3, c5, c7] = depth_of.linearisation();
        let [focal, squared, offset, slope] = depth_of.coefficients();
        Self {
            linearisation: [L::splat(c1), L::splat(c3), L::splat(c5), L::splat(c7)],
            focal: L::splat(focal),
            squared: L::splat(squared),
            offset: L::splat(offset),
            slope: L::splat(slope),
        }
    }

    #[inline(always)]
    fn of(&self, alpha: L) -> L {
        let square = alpha.mul(alpha);
        let [c1, c3, c5, c7] = self.linearisation;
        let factor = c7.mul_add(square, c5).mul_add(square, c3).mul_add(square, c1);
        let divisor = self.slope.mul_add(alpha.mul(factor), self.offset);
        self.squared.mul_add(divisor.reciprocal(), self.focal)
    }
}

#[inline(always)]
fn order<L: Lanes>(values: &mut [L], low: usize, high: usize) {
    let [a, b] = [values[low], values[high]];
    values[low] = a.min(b);
    values[high] = a.max(b);
}

/// Sorting networks with the fewest exchanges: 3, 9 and 16 (Knuth, The Art of Computer Programming 3, section 5.3.4).
#[inline(always)]
fn sort<L: Lanes, const SIDE: usize>(values: &mut [L; SIDE]) {
    match SIDE {
        3 => {
            order(values, 0, 1);
            order(values, 1, 2);
            order(values, 0, 1);
        }
        5 => {
            order(values, 0, 3);
            order(values, 1, 4);
            order(values, 0, 2);
            order(values, 1, 3);
            order(values, 0, 1);
            order(values, 2, 4);
            order(values, 1, 2);
            order(values, 3, 4);
            order(values, 2, 3);
        }
        _ => {
            order(values, 0, 6);
            order(values, 2, 3);
            order(values, 4, 5);
            order(values, 0, 2);
            order(values, 1, 4);
            order(values, 3, 6);
            order(values, 0, 1);
            order(values, 2, 5);
            order(values, 3, 4);
            order(values, 1, 2);
            order(values, 4, 6);
            order(values, 2, 3);
            order(values, 4, 5);
            order(values, 1, 2);
            order(values, 3, 4);
            order(values, 5, 6);
        }
    }
}

/// Neither extreme of `n` values, at least half of all plus one, is the median: one new value replaces both.
macro_rules! forget {
    ($lanes:ident, $kept:ident, $rest:ident: $($n:literal)+) => {{
        let mut next = 0;
        $(
            extremes_to_ends::<$lanes, $n>(&mut $kept);
            // The new value replaces the smallest; counting one less drops the largest.
            if $n > 3 {
                $kept[0] = $rest[next];
                next += 1;
            }
        )+
        let _ = next;
        $kept[1]
    }};
}
/// Median of a window with sorted columns; `ranks[i]` are the columns' values of rank `i`.
#[inline(always)]
fn median_of_sorted<L: Lanes, const SIDE: usize>(ranks: &[[L; SIDE]; SIDE]) -> L {
    let mut kept = [L::splat(0.0); 16];
    let mut rest = [L::splat(0.0); 16];
    match SIDE {
        3 => {
            let low = ranks[0][0].max(ranks[0][1]).max(ranks[0][2]);
            let high = ranks[2][0].min(ranks[2][1]).min(ranks[2][2]);
            let middle = middle_of_three(ranks[1][0], ranks[1][1], ranks[1][2]);
            middle_of_three(low, middle, high)
        }
        5 => {
            // By rank 2, 3, 3, 3, 2 of the band: initially 8, then 5 more.
            keep::<L, SIDE, 2, LARGEST>(&ranks[0], &mut kept, 0);
            keep::<L, SIDE, 2, SMALLEST>(&ranks[4], &mut kept, 2);
            without::<L, SIDE, 2, SMALLEST>(&ranks[1], &mut kept, 4);
            without::<L, SIDE, 2, LARGEST>(&ranks[3], &mut rest, 0);
            kept[7] = rest[0];
            let middle = without_extremes(&ranks[2]);
            [rest[0], rest[3], rest[4]] = [middle[1], middle[2], middle[3]];
            forget!(L, kept, rest: 8 7 6 5 4 3)
        }
        _ => {
            // By rank 3, 4, 5, 5, 5, 4, 3 of the band: initially 16, then 13 more.
            keep::<L, SIDE, 3, LARGEST>(&ranks[0], &mut kept, 0);
            keep::<L, SIDE, 3, SMALLEST>(&ranks[6], &mut kept, 3);
            without::<L, SIDE, 3, SMALLEST>(&ranks[1], &mut kept, 6);
            without::<L, SIDE, 3, LARGEST>(&ranks[5], &mut kept, 10);
            without::<L, SIDE, 2, SMALLEST>(&ranks[2], &mut rest, 0);
            without::<L, SIDE, 2, LARGEST>(&ranks[4], &mut rest, 5);
            [kept[14], kept[15]] = [rest[8], rest[9]];
            let middle = without_extremes(&ranks[3]);
            rest[8..13].copy_from_slice(&middle[1..6]);
            forget!(L, kept, rest: 16 15 14 13 12 11 10 9 8 7 6 5 4 3)
        }
    }
}

#[inline(always)]
fn extremes_to_ends<L: Lanes, const N: usize>(values: &mut [L; 16]) {
    for i in 0..N / 2 {
        order(values, i, N - 1 - i);
    }
    for i in 1..N.div_ceil(2) {
        order(values, 0, i);
    }
    for i in N / 2..N - 1 {
        order(values, i, N - 1);
    }
}

const LARGEST: bool = true;
const SMALLEST: bool = false;

/// Writes the `KEEP` largest or smallest to `output` from `at` on, by insertion.
#[inline(always)]
fn keep<L: Lanes, const SIDE: usize, const KEEP: usize, const END: bool>(
    values: &[L; SIDE],
    output: &mut [L; 16],
    at: usize,
) {
    for i in 0..SIDE {
        let mut value = values[i];
        for place in 0..KEEP.min(i) {
            let kept = output[at + place];
            let (least, most) = (kept.min(value), kept.max(value));
            (output[at + place], value) = if END == LARGEST { (most, least) } else { (least, most) };
        }
        if i < KEEP {
            output[at + i] = value;
        }
    }
}

/// Writes all but the `DROP` smallest or largest to `output` from `at` on.
#[inline(always)]
fn without<L: Lanes, const SIDE: usize, const DROP: usize, const END: bool>(
    values: &[L; SIDE],
    output: &mut [L; 16],
    at: usize,
) {
    let mut values = *values;
    for dropped in 0..DROP {
        for i in dropped + 1..SIDE {
            if END == LARGEST { order(&mut values, i, dropped) } else { order(&mut values, dropped, i) }
        }
    }
    for i in DROP..SIDE {
        output[at + i - DROP] = values[i];
    }
}

#[inline(always)]
fn without_extremes<L: Lanes, const SIDE: usize>(values: &[L; SIDE]) -> [L; SIDE] {
    let mut values = *values;
    for i in 0..SIDE / 2 {
        order(&mut values, i, SIDE - 1 - i);
    }
    for i in 1..SIDE.div_ceil(2) {
        order(&mut values, 0, i);
    }
    for i in SIDE / 2..SIDE - 1 {
        order(&mut values, i, SIDE - 1);
    }
    values
}

#[inline(always)]
fn middle_of_three<L: Lanes>(a: L, b: L, c: L) -> L {
    a.min(b).max(a.max(b).min(c))
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Portable;
    use super::*;

    fn medians_are_those_of_sorting<const SIDE: usize>() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) % 50) as f32
        };
        for _ in 0..2_000 {
            let mut ranks = [[Portable::splat(0.0); SIDE]; SIDE];
            let mut all = Vec::new();
            for x in 0..SIDE {
                let mut column: [f32; SIDE] = std::array::from_fn(|_| random());
                all.extend(column);
                let mut sorted = column.map(Portable::splat);
                sort(&mut sorted);
                column.sort_by(f32::total_cmp);
                for i in 0..SIDE {
                    assert_eq!(sorted[i].to_array()[0], column[i]);
                    ranks[i][x] = sorted[i];
                }
            }
            all.sort_by(f32::total_cmp);
            assert_eq!(median_of_sorted(&ranks).to_array()[0], all[all.len() / 2]);
        }
    }

    #[test]
    fn medians_of_all_windows_are_those_of_sorting() {
        medians_are_those_of_sorting::<3>();
        medians_are_those_of_sorting::<5>();
        medians_are_those_of_sorting::<7>();
    }
}
