//! Convolution with an eight-fold symmetric kernel, a stream of row blocks in, a stream of row blocks out.
//!
//! A vector of columns is walked downwards. The columns left and right of the centre share their taps, so each input
//! row is first folded to `r + 1` vectors; each of the `r + 1` distinct kernel rows then costs `r + 1` multiply-adds,
//! and its sum goes to the two output rows above and below that share it. The `2 r + 1` pending output rows stay in
//! registers; between blocks the unfinished ones wait in `pending`, so nothing is computed twice. For 7x7 that is 16
//! multiply-adds and 10 additions per pixel instead of 49 multiply-adds: the cost of a rank-2 separable kernel, but exact.

use super::lanes::Lanes;
use super::{Plane, dispatch};
use crate::kernel::Kernel;

/// A kernel's free coefficients, ready for the loop, and the rows that wait for more input.
#[derive(Debug, Clone)]
pub(crate) struct Taps {
    size: usize,
    octant: Vec<f32>,
    pending: Plane,
}

impl Taps {
    /// For rows of `width` output columns.
    pub fn new(kernel: &Kernel, width: usize) -> Self {
        let octant = kernel.octant().iter().map(|c| *c as f32).collect();
        Self { size: kernel.size(), octant, pending: Plane::new(kernel.size() - 1, width) }
    }

    /// Forgets what was begun.
    pub fn reset(&mut self) {
        self.pending.all_mut().fill(0.0);
    }
}

dispatch! {
    /// Feeds the first `rows` rows of `input`; writes as many rows of `width` columns to `output` from its row `first`
    /// on. The output lags behind by `size - 1` rows: the first ones after a reset are unfinished and to be dropped.
    fn convolve(taps: &mut Taps, input: &Plane, output: &mut Plane, first: usize, rows: usize, width: usize) = by_size
}

#[inline(always)]
fn by_size<L: Lanes>(
    taps: &mut Taps,
    input: &Plane,
    output: &mut Plane,
    first: usize,
    rows: usize,
    width: usize,
) {
    assert!(rows <= input.rows() && first + rows <= output.rows() && taps.pending.rows() + 1 == taps.size);
    for plane in [input, output, &taps.pending] {
        // A vector starts below `width`, reads 2 N <= 32 numbers and stays in the row's padding.
        assert!(width + Plane::PADDING <= plane.stride());
    }
    match taps.size {
        5 => walk::<L, 5, 3>(taps, input, output, first, rows, width),
        7 => walk::<L, 7, 4>(taps, input, output, first, rows, width),
        9 => walk::<L, 9, 5>(taps, input, output, first, rows, width),
        11 => walk::<L, 11, 6>(taps, input, output, first, rows, width),
        // `Kernel` has no other size.
        _ => unreachable!("kernel size {}", taps.size),
    }
}

/// `SIZE` is the kernel's side, `FOLDED = SIZE / 2 + 1`.
#[inline(always)]
fn walk<L: Lanes, const SIZE: usize, const FOLDED: usize>(
    taps: &mut Taps,
    input: &Plane,
    output: &mut Plane,
    first: usize,
    rows: usize,
    width: usize,
) {
    let r = FOLDED - 1;
    assert!(taps.octant.len() == FOLDED * (FOLDED + 1) / 2);
    // Splatting from the octant lets equal coefficients share a register.
    let mut octant = [L::splat(0.0); 21];
    for i in 0..FOLDED * (FOLDED + 1) / 2 {
        octant[i] = L::splat(taps.octant[i]);
    }
    let pending_stride = taps.pending.stride();
    let [input_stride, output_stride] = [input.stride(), output.stride()];
    let pending_base = taps.pending.all_mut().as_mut_ptr();
    let input_base = input.all().as_ptr();
    let output_base = output.all_mut().as_mut_ptr();
    for x in (0..width).step_by(L::N) {
        // SAFETY: x < width and `by_size` asserted width + 32 <= stride for all planes, so the N numbers at x (2 N <= 32
        // for the taps) lie in the row; row indices are below the planes' rows, asserted there.
        unsafe {
            let pending = pending_base.add(x);
            // The first output row that is not finished comes first. A row of input is added to all of them, which at
            // the same time moves them up; two arrays, because a shift within one would keep it out of registers.
            let mut sums = [L::splat(0.0); SIZE];
            for i in 0..SIZE - 1 {
                sums[i] = L::load(pending.add(i * pending_stride));
            }
            for y in 0..rows {
                let columns: [L; SIZE] = L::taps(input_base.add(y * input_stride + x));
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
                sums[0].add(products[r]).store(output_base.add((first + y) * output_stride + x));
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

/// Place of the tap (a, b) among the free coefficients.
#[inline(always)]
const fn index(a: usize, b: usize) -> usize {
    let [long, short] = if a > b { [a, b] } else { [b, a] };
    long * (long + 1) / 2 + short
}
