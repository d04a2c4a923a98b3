//! The cubic of a row, from the window sums of its coefficients to alpha and misfit.

use super::lanes::Lanes;
use super::{Backend, Plane, dispatch};
use crate::cubic::{LEAST_T, MAX_ALPHA, SLOPE_FLOOR, START, STEPS};

/// Texture energy that stands for none: keeps divisions finite, far below any real one (images are normalised).
pub(super) const TINY: f32 = 1e-30;

/// What [`CubicRow::solve`] writes: rows with padding.
pub(crate) struct CubicRow<'a> {
    /// Normalised depth before the median.
    pub alpha: &'a mut [f32],
    /// Texture energy c1.
    pub texture: &'a mut [f32],
    /// Misfit relative to c1.
    pub misfit: &'a mut [f32],
}

impl CubicRow<'_> {
    /// Sums the four rows `4 y ..` of `sums` over `window` columns and solves the cubic for `width` columns.
    pub fn solve(&mut self, backend: Backend, sums: &Plane, y: usize, window: usize, width: usize) {
        solve(backend, self, sums, y, window, width);
    }
}

dispatch! {
    fn solve(output: &mut CubicRow<'_>, sums: &Plane, y: usize, window: usize, width: usize) = solve_generic
}

#[inline(always)]
fn solve_generic<L: Lanes>(
    has: L::Has,
    output: &mut CubicRow<'_>,
    sums: &Plane,
    y: usize,
    window: usize,
    width: usize,
) {
    let rows = [0, 1, 2, 3].map(|c| sums.row(4 * y + c));
    let mut channels = rows.map(|row| Channel::<L>::new(has, row));
    for x in (0..width).step_by(L::INTERLEAVED * L::N) {
        let mut window_sums = [[L::splat(has, 0.0); 4]; 2];
        for half in 0..L::INTERLEAVED {
            for c in 0..4 {
                window_sums[half][c] = if window == 7 {
                    channels[c].sum_of_seven(x + half * L::N)
                } else {
                    sum_of(has, &rows[c][x + half * L::N..], window)
                };
            }
        }
        let mut results = [[L::splat(has, 0.0); 2]; 2];
        for half in 0..L::INTERLEAVED {
            results[half] = root_and_misfit(has, window_sums[half]);
        }
        for half in 0..L::INTERLEAVED {
            let at = x + half * L::N;
            results[half][0].store(&mut output.alpha[at..]);
            window_sums[half][0].store(&mut output.texture[at..]);
            results[half][1].store(&mut output.misfit[at..]);
        }
    }
}

/// Window sums over seven columns, vector after vector: sums of two are shared between neighbouring lanes and vectors,
/// so that four additions make a sum of seven.
struct Channel<'a, L: Lanes> {
    has: L::Has,
    row: &'a [f32],
    here: L,
    next: L,
    /// Each lane of `here` plus the one after.
    pairs: L,
}

impl<'a, L: Lanes> Channel<'a, L> {
    #[inline(always)]
    fn new(has: L::Has, row: &'a [f32]) -> Self {
        let [here, next] = [L::load(has, row), L::load(has, &row[L::N..])];
        Self { has, row, here, next, pairs: here.add(L::beside::<1>(has, row, here, next)) }
    }

    /// The sums that begin in the vector at `x`; `x` must grow by `N` from call to call, from 0. Reads 3 N numbers.
    #[inline(always)]
    fn sum_of_seven(&mut self, x: usize) -> L {
        let from = &self.row[x..];
        let after_next = L::load(self.has, &from[2 * L::N..]);
        let next_pairs = self.next.add(L::beside::<1>(self.has, &from[L::N..], self.next, after_next));
        let four = self.pairs.add(self.pairs.after::<2>(next_pairs));
        let beyond = L::beside::<6>(self.has, from, self.here, self.next);
        let three = self.pairs.after::<4>(next_pairs).add(beyond);
        [self.here, self.next, self.pairs] = [self.next, after_next, next_pairs];
        four.add(three)
    }
}

/// The sums of `window` neighbours from the first numbers on.
#[inline(always)]
fn sum_of<L: Lanes>(has: L::Has, from: &[f32], window: usize) -> L {
    let mut sum = L::load(has, from);
    for i in 1..window {
        sum = sum.add(L::load(has, &from[i..]));
    }
    sum
}

/// The cubic's root ([`crate::cubic`], in vectors) and the misfit ([`confidence`]).
#[inline(always)]
fn root_and_misfit<L: Lanes>(has: L::Has, [c1, c3, c0, energy]: [L; 4]) -> [L; 2] {
    let [one, three] = [L::splat(has, 1.0), L::splat(has, 3.0)];
    let inverse = c1.max(L::splat(has, TINY)).reciprocal(has);
    let signed_ratio = c0.mul(inverse);
    let ratio = signed_ratio.abs();
    let cubic = c3.mul(inverse);
    let three_cubic = cubic.mul(three);
    let limit = L::splat(has, 0.0)
        .sub(three_cubic)
        .max(L::splat(has, 3e-6))
        .inverse_root(has)
        .min(L::splat(has, MAX_ALPHA));
    let t = cubic.mul(ratio).mul(ratio).max(L::splat(has, LEAST_T));
    let [a1, a2, b1, b2] = START;
    let above = L::splat(has, a2).mul_add(t, L::splat(has, a1)).mul_add(t, one);
    let below = L::splat(has, b2).mul_add(t, L::splat(has, b1)).mul_add(t, one);
    // An estimate suffices: Newton's steps correct it.
    let mut alpha = ratio.mul(above).mul(below.reciprocal_estimate());
    for _ in 0..STEPS {
        let square = alpha.mul(alpha);
        // As here: the value that the divisor's estimate scales is exact.
        let slope = three_cubic.mul_add(square, one).max(L::splat(has, SLOPE_FLOOR));
        let value = cubic.mul(square).mul_add(alpha, alpha.sub(ratio));
        alpha = value.neg_mul_add(slope.reciprocal_estimate(), alpha);
    }
    let left_over = c0.neg_mul_add(signed_ratio, energy).mul(inverse).max(L::splat(has, 0.0));
    [alpha.min(limit).with_sign_of(c0), left_over]
}
