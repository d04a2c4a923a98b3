//! The run time's loops besides convolution, for one row or one block of rows.

use super::lanes::Lanes;
use super::{Plane, dispatch};
use crate::confidence;
use crate::cubic::{LEAST_T, MAX_ALPHA, SLOPE_FLOOR, START, STEPS};

/// Texture energy that counts as none: keeps divisions finite, far below any real one (images are normalised).
const TINY: f32 = 1e-30;

/// Pixels counted in one f32, which is exact up to 2^24.
const COUNTED_PX: usize = 1 << 22;

/// Smallest and largest value of a row; meaningless unless all are `finite`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extremes {
    pub low: f32,
    pub high: f32,
    pub finite: bool,
}

dispatch! {
    fn extremes(values: &[f32]) -> Extremes = extremes_generic
}

#[inline(always)]
fn extremes_generic<L: Lanes>(values: &[f32]) -> Extremes {
    // Four of each, to hide latency.
    let [mut low, mut high] = [[L::splat(f32::INFINITY); 4], [L::splat(f32::NEG_INFINITY); 4]];
    let mut poison = [L::splat(0.0); 4];
    let whole = values.len() / (4 * L::N) * 4 * L::N;
    for x in (0..whole).step_by(4 * L::N) {
        for i in 0..4 {
            // SAFETY: x + 4 N <= values.len().
            let value = unsafe { L::load(values.as_ptr().add(x + i * L::N)) };
            low[i] = low[i].min(value);
            high[i] = high[i].max(value);
            // 0 times a number is 0, times NaN or infinity NaN.
            poison[i] = value.mul_add(L::splat(0.0), poison[i]);
        }
    }
    let low = low[0].min(low[1]).min(low[2].min(low[3])).to_array();
    let high = high[0].max(high[1]).max(high[2].max(high[3])).to_array();
    let poison = poison[0].add(poison[1]).add(poison[2].add(poison[3])).to_array();
    let mut result = Extremes { low: f32::INFINITY, high: f32::NEG_INFINITY, finite: true };
    for value in low[..L::N].iter().chain(&high[..L::N]).chain(&values[whole..]) {
        if value.is_finite() {
            result.low = result.low.min(*value);
            result.high = result.high.max(*value);
        }
    }
    result.finite = poison[..L::N].iter().all(|p| *p == 0.0) && values[whole..].iter().all(|v| v.is_finite());
    result
}

dispatch! {
    /// `difference = (near - far) gain`, `sum = (near + far - 2 offset) gain`; all rows have one length.
    fn normalise_row(far: &[f32], near: &[f32], offset: f32, gain: f32, difference: &mut [f32], sum: &mut [f32]) =
        normalise_generic
}

#[inline(always)]
fn normalise_generic<L: Lanes>(
    far: &[f32],
    near: &[f32],
    offset: f32,
    gain: f32,
    difference: &mut [f32],
    sum: &mut [f32],
) {
    let n = far.len();
    assert!(near.len() == n && difference.len() == n && sum.len() == n);
    for i in 0..n {
        difference[i] = (near[i] - far[i]) * gain;
        sum[i] = ((near[i] - offset) + (far[i] - offset)) * gain;
    }
}

/// Sums over the last `window` rows of the four products, without a running sum's drift: a window is the tail of one
/// group of rows and the head of the next (van Herk's scheme). Three additions per product and row.
#[derive(Debug, Clone)]
pub(crate) struct WindowRow {
    window: usize,
    phase: usize,
    /// Four sums over the head of the current group.
    heads: Plane,
    /// Per row of a group: four tails of the last group, or four products of the current one.
    tails: Plane,
}

impl WindowRow {
    pub fn new(window: usize, width: usize) -> Self {
        Self { window, phase: 0, heads: Plane::new(4, width), tails: Plane::new(4 * window, width) }
    }

    pub fn reset(&mut self) {
        self.phase = 0;
        self.heads.all_mut().fill(0.0);
        self.tails.all_mut().fill(0.0);
    }
}

dispatch! {
    /// Takes `rows` rows from `first` on; writes to rows `4 y ..` of `sums` the window sums of `p1 p1`, `p1 p2`,
    /// `p1 m`, `m m` that end with row `y`.
    fn vertical_sums(state: &mut WindowRow, inputs: [&Plane; 3], first: usize, sums: &mut Plane, rows: usize, width: usize) =
        vertical_generic
}

#[inline(always)]
fn vertical_generic<L: Lanes>(
    state: &mut WindowRow,
    [m, p1, p2]: [&Plane; 3],
    first: usize,
    sums: &mut Plane,
    rows: usize,
    width: usize,
) {
    let window = state.window;
    assert!(state.heads.rows() == 4 && state.tails.rows() == 4 * window && sums.rows() >= 4 * rows);
    assert!([m, p1, p2].iter().all(|p| p.rows() >= first + rows));
    let strides = [m, p1, p2, &*sums, &state.heads, &state.tails].map(Plane::stride);
    assert!(strides.iter().all(|s| width + Plane::PADDING <= *s));
    let [m_stride, p1_stride, p2_stride, sums_stride, heads_stride, tails_stride] = strides;
    let [m, p1, p2] = [m, p1, p2].map(|p| p.all().as_ptr());
    let sums = sums.all_mut().as_mut_ptr();
    let heads = state.heads.all_mut().as_mut_ptr();
    let tails = state.tails.all_mut().as_mut_ptr();
    for x in (0..width).step_by(L::N) {
        // SAFETY: x < width and width + PADDING <= every stride, so N numbers at x lie within a row; the row indices
        // are below the numbers of rows asserted above.
        unsafe {
            let tails = tails.add(x);
            let mut head = [L::splat(0.0); 4];
            for c in 0..4 {
                head[c] = L::load(heads.add(c * heads_stride + x));
            }
            let mut phase = state.phase;
            for y in 0..rows {
                let m = L::load(m.add((first + y) * m_stride + x));
                let p1 = L::load(p1.add((first + y) * p1_stride + x));
                let p2 = L::load(p2.add((first + y) * p2_stride + x));
                let products = [p1.mul(p1), p1.mul(p2), p1.mul(m), m.mul(m)];
                let first = phase == 0;
                let last = phase + 1 == window;
                for c in 0..4 {
                    head[c] = if first { products[c] } else { head[c].add(products[c]) };
                    let sum = if last {
                        head[c]
                    } else {
                        head[c].add(L::load(tails.add((4 * (phase + 1) + c) * tails_stride)))
                    };
                    sum.store(sums.add((4 * y + c) * sums_stride + x));
                    products[c].store(tails.add((4 * phase + c) * tails_stride));
                }
                phase += 1;
                if last {
                    phase = 0;
                    let mut sum = products;
                    for row in (0..window - 1).rev() {
                        for c in 0..4 {
                            let tail = tails.add((4 * row + c) * tails_stride);
                            sum[c] = sum[c].add(L::load(tail));
                            sum[c].store(tail);
                        }
                    }
                }
            }
            for c in 0..4 {
                head[c].store(heads.add(c * heads_stride + x));
            }
        }
    }
    state.phase = (state.phase + rows) % window;
}

/// Rows per call of [`vertical_sums_of_seven`].
pub(crate) const SEVEN_BLOCK: usize = 8;

dispatch! {
    /// As [`vertical_sums`] for seven rows, stateless: `inputs` are rings of 16 rows, new at `8 half ..`, the previous
    /// eight in the other half. Writes all eight rows of `sums`.
    fn vertical_sums_of_seven(inputs: [&Plane; 3], half: usize, sums: &mut Plane, width: usize) = seven_generic
}

#[inline(always)]
fn seven_generic<L: Lanes>([m, p1, p2]: [&Plane; 3], half: usize, sums: &mut Plane, width: usize) {
    const WINDOW: usize = 7;
    assert!(half < 2 && sums.rows() >= 4 * SEVEN_BLOCK);
    assert!([m, p1, p2].iter().all(|p| p.rows() == 2 * SEVEN_BLOCK && p.stride() == m.stride()));
    let [stride, sums_stride] = [m.stride(), sums.stride()];
    assert!(width + Plane::PADDING <= stride.min(sums_stride));
    let [m, p1, p2] = [m.all().as_ptr(), p1.all().as_ptr(), p2.all().as_ptr()];
    let sums = sums.all_mut().as_mut_ptr();
    // Row 0 is the oldest of the six before the first new one, row 6 the first new one.
    let start = SEVEN_BLOCK * (1 - half) + 2;
    for x in (0..width).step_by(L::N) {
        // SAFETY: x < width and width + PADDING <= both strides, so N numbers at x lie within a row; the rows are taken
        // modulo the 16 rows asserted above, and 4 * 8 rows of sums were asserted.
        unsafe {
            // Windows are the tail of rows 0 to 6 and the head of rows 7 to 13.
            let mut tails = [[L::splat(0.0); 4]; WINDOW];
            let mut sum = products::<L>(m, p1, p2, (start + 6) % 16 * stride + x);
            tails[6] = sum;
            for i in (0..6).rev() {
                let products = products::<L>(m, p1, p2, (start + i) % 16 * stride + x);
                for c in 0..4 {
                    sum[c] = sum[c].add(products[c]);
                }
                tails[i] = sum;
            }
            let mut head = [L::splat(0.0); 4];
            for y in 0..SEVEN_BLOCK {
                if y > 0 {
                    let products = products::<L>(m, p1, p2, (start + y + 6) % 16 * stride + x);
                    for c in 0..4 {
                        head[c] = if y == 1 { products[c] } else { head[c].add(products[c]) };
                    }
                }
                for c in 0..4 {
                    let sum = match y {
                        0 => tails[0][c],
                        WINDOW => head[c],
                        _ => tails[y][c].add(head[c]),
                    };
                    sum.store(sums.add((4 * y + c) * sums_stride + x));
                }
            }
        }
    }
}

/// `p1 p1`, `p1 p2`, `p1 m`, `m m` at an offset into the planes.
///
/// # Safety
/// `N` numbers must be readable at the offset from each pointer.
#[inline(always)]
unsafe fn products<L: Lanes>(m: *const f32, p1: *const f32, p2: *const f32, offset: usize) -> [L; 4] {
    // SAFETY: the caller's promise.
    let [m, p1, p2] = unsafe { [L::load(m.add(offset)), L::load(p1.add(offset)), L::load(p2.add(offset))] };
    [p1.mul(p1), p1.mul(p2), p1.mul(m), m.mul(m)]
}

/// Output of [`CubicRow::solve`]: rows with padding.
pub(crate) struct CubicRow<'a> {
    /// Before the median; the misfit is relative to c1.
    pub alpha: &'a mut [f32],
    pub texture: &'a mut [f32],
    pub misfit: &'a mut [f32],
}

impl CubicRow<'_> {
    /// Sums rows `4 y ..` of `sums` over `window` columns and solves the cubic for `width` columns.
    pub fn solve(
        &mut self,
        backend: crate::simd::Backend,
        sums: &Plane,
        y: usize,
        window: usize,
        width: usize,
    ) {
        solve(backend, self, sums, y, window, width);
    }
}

dispatch! {
    fn solve(output: &mut CubicRow<'_>, sums: &Plane, y: usize, window: usize, width: usize) = solve_generic
}

#[inline(always)]
fn solve_generic<L: Lanes>(output: &mut CubicRow<'_>, sums: &Plane, y: usize, window: usize, width: usize) {
    let stride = sums.stride();
    assert!(
        4 * y + 4 <= sums.rows()
            && width + Plane::PADDING <= stride
            && window - 1 + 32 <= Plane::PADDING
            && 64 < Plane::PADDING
    );
    let [alpha, texture, misfit] = [&mut *output.alpha, output.texture, output.misfit];
    assert!([&*alpha, texture, misfit].iter().all(|row| width + Plane::PADDING <= row.len()));
    let [alpha, texture, misfit] = [alpha.as_mut_ptr(), texture.as_mut_ptr(), misfit.as_mut_ptr()];
    let base = sums.all()[4 * y * stride..].as_ptr();
    // SAFETY: four rows of `stride` numbers begin at `base`; x < width, so reads stay below x + N + max(window - 1 + N, 3 N + 1) <=
    // width + PADDING, asserted to lie in the row, and so do the 2 N numbers that are written; the output rows are as long.
    unsafe {
        let mut channels = [
            Channel::<L>::new(base),
            Channel::<L>::new(base.add(stride)),
            Channel::<L>::new(base.add(2 * stride)),
            Channel::<L>::new(base.add(3 * stride)),
        ];
        for x in (0..width).step_by(L::INTERLEAVED * L::N) {
            let mut window_sums = [[L::splat(0.0); 4]; 2];
            for half in 0..L::INTERLEAVED {
                for c in 0..4 {
                    window_sums[half][c] = if window == 7 {
                        channels[c].sum_of_seven(x + half * L::N)
                    } else {
                        sum_of(base.add(c * stride + x + half * L::N), window)
                    };
                }
            }
            let mut results = [[L::splat(0.0); 2]; 2];
            for half in 0..L::INTERLEAVED {
                results[half] = root_and_misfit(window_sums[half]);
            }
            for half in 0..L::INTERLEAVED {
                let at = x + half * L::N;
                results[half][0].store(alpha.add(at));
                window_sums[half][0].store(texture.add(at));
                results[half][1].store(misfit.add(at));
            }
        }
    }
}

/// Window sums over seven columns: neighbouring lanes share sums of two, so that four additions make a sum of seven.
struct Channel<L> {
    row: *const f32,
    here: L,
    next: L,
    /// Each lane of `here` plus the next.
    pairs: L,
}

impl<L: Lanes> Channel<L> {
    /// # Safety
    /// 3 N numbers must be readable at `row`.
    #[inline(always)]
    unsafe fn new(row: *const f32) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            let [here, next] = [L::load(row), L::load(row.add(L::N))];
            Self { row, here, next, pairs: here.add(L::beside::<1>(row, here, next)) }
        }
    }

    /// The sums that begin in the vector at `x`; `x` must grow by `N` per call, from 0.
    ///
    /// # Safety
    /// 3 N + 1 numbers must be readable at `x`.
    #[inline(always)]
    unsafe fn sum_of_seven(&mut self, x: usize) -> L {
        let p = self.row.wrapping_add(x);
        // SAFETY: the caller's promise.
        unsafe {
            let after_next = L::load(p.add(2 * L::N));
            let next_pairs = self.next.add(L::beside::<1>(p.add(L::N), self.next, after_next));
            let four = self.pairs.add(self.pairs.after::<2>(next_pairs));
            let three = self.pairs.after::<4>(next_pairs).add(L::beside::<6>(p, self.here, self.next));
            [self.here, self.next, self.pairs] = [self.next, after_next, next_pairs];
            four.add(three)
        }
    }
}

/// # Safety
/// `window + N` numbers must be readable at `p`.
#[inline(always)]
unsafe fn sum_of<L: Lanes>(p: *const f32, window: usize) -> L {
    // SAFETY: the caller's promise.
    unsafe {
        let mut sum = L::load(p);
        for i in 1..window {
            sum = sum.add(L::load(p.add(i)));
        }
        sum
    }
}

/// The cubic's root ([`crate::cubic`], vectorised) and the misfit ([`confidence`]).
#[inline(always)]
fn root_and_misfit<L: Lanes>([c1, c3, c0, energy]: [L; 4]) -> [L; 2] {
    let [one, three] = [L::splat(1.0), L::splat(3.0)];
    let inverse = c1.max(L::splat(TINY)).reciprocal();
    let signed_ratio = c0.mul(inverse);
    let ratio = signed_ratio.abs();
    let cubic = c3.mul(inverse);
    let three_cubic = cubic.mul(three);
    let limit = L::splat(0.0).sub(three_cubic).max(L::splat(3e-6)).inverse_root().min(L::splat(MAX_ALPHA));
    let t = cubic.mul(ratio).mul(ratio).max(L::splat(LEAST_T));
    let [a1, a2, b1, b2] = START;
    let above = L::splat(a2).mul_add(t, L::splat(a1)).mul_add(t, one);
    let below = L::splat(b2).mul_add(t, L::splat(b1)).mul_add(t, one);
    // An estimate suffices: Newton's steps correct it.
    let mut alpha = ratio.mul(above).mul(below.reciprocal_estimate());
    for _ in 0..STEPS {
        let square = alpha.mul(alpha);
        // Likewise: the value that the estimate scales is exact.
        let slope = three_cubic.mul_add(square, one).max(L::splat(SLOPE_FLOOR));
        let value = cubic.mul(square).mul_add(alpha, alpha.sub(ratio));
        alpha = value.neg_mul_add(slope.reciprocal_estimate(), alpha);
    }
    let left_over = c0.neg_mul_add(signed_ratio, energy).mul(inverse).max(L::splat(0.0));
    [alpha.min(limit).with_sign_of(c0), left_over]
}

dispatch! {
    /// Texture to confidence in place ([`confidence::confidence`]); counts pixels of low texture and none.
    fn confidence_row(texture: &mut [f32], misfit: &[f32], scale: f32) -> [usize; 2] = confidence_generic
}

#[inline(always)]
fn confidence_generic<L: Lanes>(texture: &mut [f32], misfit: &[f32], scale: f32) -> [usize; 2] {
    assert!(texture.len() == misfit.len());
    let (mut low, mut without) = (0, 0);
    for (texture, misfit) in texture.chunks_mut(COUNTED_PX).zip(misfit.chunks(COUNTED_PX)) {
        let [of_low, of_without] = confidence_chunk::<L>(texture, misfit, scale);
        low += of_low;
        without += of_without;
    }
    [low, without]
}

/// [`confidence_generic`] of at most [`COUNTED_PX`] pixels.
#[inline(always)]
fn confidence_chunk<L: Lanes>(texture: &mut [f32], misfit: &[f32], scale: f32) -> [usize; 2] {
    let threshold = confidence::LOW_TEXTURE * scale;
    let least = confidence::NO_TEXTURE * scale;
    let [mut low, mut with] = [L::splat(0.0); 2];
    let whole = texture.len() / L::N * L::N;
    for x in (0..whole).step_by(L::N) {
        // SAFETY: x + N <= the length of both.
        unsafe {
            let energy = L::load(texture.as_ptr().add(x));
            let misfit = L::load(misfit.as_ptr().add(x));
            low = low.add(energy.one_where_less(L::splat(threshold)));
            let any = L::splat(least).one_where_less(energy);
            with = with.add(any);
            let divisor = energy.add(L::splat(threshold));
            let divisor = divisor.mul_add(misfit, divisor).max(L::splat(TINY));
            any.mul(energy).mul(divisor.reciprocal()).store(texture.as_mut_ptr().add(x));
        }
    }
    let [low, with] = [low.to_array(), with.to_array()];
    let [mut low, mut with] = [&low[..L::N], &with[..L::N]].map(|counts| counts.iter().sum::<f32>() as usize);
    for (texture, misfit) in texture[whole..].iter_mut().zip(&misfit[whole..]) {
        low += usize::from(*texture < threshold);
        *texture = confidence::confidence(*texture, *misfit, scale);
        with += usize::from(*texture > 0.0);
    }
    [low, texture.len() - with]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    #[test]
    fn rows_of_confidence_agree_with_the_formula() {
        let texture: Vec<f32> =
            (0..83).map(|i| if i % 7 == 0 { 0.0 } else { 1e-9 * 1.5_f32.powi(i) }).collect();
        let misfit: Vec<f32> = (0..83).map(|i| 0.3 * (i % 11) as f32).collect();
        for scale in [0.0, 1e-3, 5.0] {
            for backend in Backend::available() {
                let mut found = texture.clone();
                let [low, without] = confidence_row(backend, &mut found, &misfit, scale);
                assert_eq!(low, texture.iter().filter(|t| **t < 0.05 * scale).count());
                assert_eq!(without, found.iter().filter(|c| **c == 0.0).count());
                for ((texture, misfit), found) in texture.iter().zip(&misfit).zip(&found) {
                    let expected = confidence::confidence(*texture, *misfit, scale);
                    assert!((found - expected).abs() < 1e-6, "{backend:?} {texture}: {found} {expected}");
                }
            }
        }
    }

    /// 17 million pixels in one row, as two threads have of a 34 MP image.
    #[test]
    fn counts_are_exact_beyond_what_one_float_can_count() {
        let misfit = vec![0.0; (1 << 24) + 1001];
        for backend in Backend::available() {
            let mut texture = vec![0.0; misfit.len()];
            assert_eq!(confidence_row(backend, &mut texture, &misfit, 1.0), [misfit.len(); 2]);
        }
    }

    #[test]
    fn extremes_know_what_is_not_finite() {
        let mut values: Vec<f32> = (0..150).map(|i| ((i * 37) % 150) as f32 - 20.0).collect();
        for backend in Backend::available() {
            assert_eq!(extremes(backend, &values), Extremes { low: -20.0, high: 129.0, finite: true });
        }
        for at in [3, 149] {
            values[at] = f32::NAN;
            for backend in Backend::available() {
                assert!(!extremes(backend, &values).finite, "{backend:?} {at}");
            }
            values[at] = 0.0;
        }
    }
}
