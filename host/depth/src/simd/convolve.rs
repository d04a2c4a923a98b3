//! Convolution with an eight-fold symmetric kernel, from a stream of row blocks to a stream of row blocks.
//!
//! A vector of columns moves downwards. Columns left and right of the centre share their taps, so each input row is
//! first folded to `r + 1` vectors. Each of the `r + 1` distinct kernel rows then costs `r + 1` multiply-adds, and its
//! sum goes to both output rows that share it. The `2 r + 1` unfinished output rows stay in registers, and in `pending`
//! between blocks, so nothing is computed twice. For 7x7 that is 16 multiply-adds and 10 additions per pixel instead of
//! 49 multiply-adds: the cost of a rank-2 separable kernel, but exact.

use super::lanes::Lanes;
use super::{Plane, dispatch};
use crate::kernel::{Kernel, LARGEST_SIZE, free_coefficients, with_size};

/// A kernel's free coefficients for the loop, and the unfinished rows.
#[derive(Debug, Clone)]
pub(crate) struct Taps {
    size: usize,
    octant: Vec<f32>,
    pending: Plane,
}

impl Taps {
    pub fn new(kernel: &Kernel, width: usize) -> Self {
        let octant = kernel.octant().iter().map(|c| *c as f32).collect();
        Self { size: kernel.size(), octant, pending: Plane::new(kernel.size() - 1, width) }
    }

    pub fn size(&self) -> usize {
        self.size
    }

    pub fn reset(&mut self) {
        self.pending.all_mut().fill(0.0);
    }
}

/// Most rows per call.
pub(crate) const MAX_ROWS: usize = 8;

dispatch! {
    /// Convolves at most [`MAX_ROWS`] rows of `input`, each [`READ_BEYOND`] numbers longer than `width`. The last
    /// vector of an `output` row may exceed the width. The output lags by `size - 1` rows, invalid after a reset.
    fn convolve_rows(taps: &mut Taps, input: &[&[f32]], output: &mut [&mut [f32]], width: usize) = by_size
}

/// Numbers read beyond the width of each row: 32 from the start of its last vector.
pub(crate) const READ_BEYOND: usize = 31;

/// As [`convolve_rows`] for the first `rows` rows of `input`, to rows of `output` from `first` on.
pub(crate) fn convolve(
    backend: crate::simd::Backend,
    taps: &mut Taps,
    input: &Plane,
    output: &mut Plane,
    first: usize,
    rows: usize,
    width: usize,
) {
    let mut input_rows: [&[f32]; MAX_ROWS] = [&[]; MAX_ROWS];
    for (y, row) in input_rows[..rows].iter_mut().enumerate() {
        *row = input.row(y);
    }
    let mut output_rows: [&mut [f32]; MAX_ROWS] = Default::default();
    let stride = output.stride();
    let planes = output.all_mut()[first * stride..].chunks_exact_mut(stride);
    output_rows[..rows].iter_mut().zip(planes).for_each(|(to, row)| *to = row);
    convolve_rows(backend, taps, &input_rows[..rows], &mut output_rows[..rows], width);
}

#[inline(always)]
fn by_size<L: Lanes>(taps: &mut Taps, input: &[&[f32]], output: &mut [&mut [f32]], width: usize) {
    assert!(input.len() <= MAX_ROWS && output.len() == input.len() && taps.pending.rows() + 1 == taps.size);
    let vectors = width.next_multiple_of(L::N);
    assert!(input.iter().all(|row| width + READ_BEYOND <= row.len() && vectors - L::N + 32 <= row.len()));
    assert!(output.iter().all(|row| vectors <= row.len()) && vectors <= taps.pending.stride());
    with_size!(taps.size, SIZE => walk::<L, SIZE, { SIZE / 2 + 1 }>(taps, input, output, width))
}

/// `SIZE` is the kernel's side, `FOLDED = SIZE / 2 + 1`.
#[inline(always)]
fn walk<L: Lanes, const SIZE: usize, const FOLDED: usize>(
    taps: &mut Taps,
    input: &[&[f32]],
    output: &mut [&mut [f32]],
    width: usize,
) {
    let r = FOLDED - 1;
    assert!(taps.octant.len() == FOLDED * (FOLDED + 1) / 2);
    // Splatting from the octant lets equal coefficients share a register.
    let mut octant = [L::splat(0.0); free_coefficients(LARGEST_SIZE)];
    for i in 0..FOLDED * (FOLDED + 1) / 2 {
        octant[i] = L::splat(taps.octant[i]);
    }
    let pending_stride = taps.pending.stride();
    let mut rows = [(std::ptr::null::<f32>(), std::ptr::null_mut::<f32>()); MAX_ROWS];
    for y in 0..input.len() {
        rows[y] = (input[y].as_ptr(), output[y].as_mut_ptr());
    }
    let rows = &rows[..input.len()];
    let pending_base = taps.pending.all_mut().as_mut_ptr();
    for x in (0..width).step_by(L::N) {
        // SAFETY: x is a multiple of N below the width, and `by_size` asserted that from there on 32 numbers lie in each row
        // of input and N in each row of output and of `pending`, which has SIZE - 1 rows.
        unsafe {
            let pending = pending_base.add(x);
            // The first unfinished output row comes first. Each input row is added to all of them and moves them up;
            // two arrays, because a shift within one would prevent registers.
            let mut sums = [L::splat(0.0); SIZE];
            for i in 0..SIZE - 1 {
                sums[i] = L::load(pending.add(i * pending_stride));
            }
            for (from, to) in rows {
                let columns: [L; SIZE] = L::taps(from.add(x));
                let mut folded = [columns[r]; FOLDED];
                for i in 1..FOLDED {
                    folded[i] = columns[r - i].add(columns[r + i]);
                }
                let mut products = [columns[r]; FOLDED];
                for dy in 0..FOLDED {
                    products[dy] = octant[index(dy, 0)].mul(folded[0]);
                    for dx in 1..FOLDED {
                        products[dy] = octant[index(dy, dx)].mul_add(folded[dx], products[dy]);
                    }
                }
                sums[0].add(products[r]).store(to.add(x));
                let mut moved = [L::splat(0.0); SIZE];
                for i in 1..SIZE {
                    moved[i - 1] = sums[i].add(products[i.abs_diff(r)]);
                }
                sums = moved;
            }
            for i in 0..SIZE - 1 {
                sums[i].store(pending.add(i * pending_stride));
            }
        }
    }
}

#[inline(always)]
const fn index(a: usize, b: usize) -> usize {
    let [long, short] = if a > b { [a, b] } else { [b, a] };
    long * (long + 1) / 2 + short
}
