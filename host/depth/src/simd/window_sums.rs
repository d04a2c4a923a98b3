//! Sums over the rows of a window of the products that the cubic's coefficients are made of.

use super::lanes::Lanes;
use super::{Plane, dispatch};

/// Sums over the last `window` rows of the four products, without the drift of a running sum.
///
/// Rows come in groups of `window`. A window is the tail of one group and the head of the next: tails are summed
/// once per group, heads on the way (van Herk's scheme for sums). Three additions per product and row.
#[derive(Debug)]
pub(crate) struct WindowRow {
    window: usize,
    /// Position of the next row in its group.
    phase: usize,
    /// Four sums over the head of the running group.
    heads: Plane,
    /// For each row of a group four tails of the last group, or four products of the running one.
    tails: Plane,
}

impl WindowRow {
    /// For windows of `window` rows of `width` columns.
    pub fn new(window: usize, width: usize) -> Self {
        Self { window, phase: 0, heads: Plane::new(4, width), tails: Plane::new(4 * window, width) }
    }

    /// Forgets what was begun.
    pub fn reset(&mut self) {
        self.phase = 0;
        self.heads.all_mut().fill(0.0);
        self.tails.all_mut().fill(0.0);
    }
}

dispatch! {
    /// Feeds `rows` rows, from `first` on, of the inputs `m`, `p1`, `p2`; writes to rows `4 y ..` of `sums` the window sums of `p1 p1`, `p1 p2`,
    /// `p1 m`, `m m` that end with row `y`.
    fn vertical_sums(state: &mut WindowRow, inputs: [&Plane; 3], first: usize, sums: &mut Plane, rows: usize, width: usize) =
        vertical_generic
}

#[inline(always)]
fn vertical_generic<L: Lanes>(
    has: L::Has,
    state: &mut WindowRow,
    inputs: [&Plane; 3],
    first: usize,
    sums: &mut Plane,
    rows: usize,
    width: usize,
) {
    let window = state.window;
    let [heads_stride, tails_stride, sums_stride] = [&state.heads, &state.tails, &*sums].map(Plane::stride);
    let [heads, tails, sums] = [state.heads.all_mut(), state.tails.all_mut(), sums.all_mut()];
    for x in (0..width).step_by(L::N) {
        let mut head = [L::splat(has, 0.0); 4];
        for c in 0..4 {
            head[c] = L::load(has, &heads[c * heads_stride + x..]);
        }
        let mut phase = state.phase;
        for y in 0..rows {
            let products = products::<L>(has, inputs, first + y, x);
            let first = phase == 0;
            let last = phase + 1 == window;
            for c in 0..4 {
                head[c] = if first { products[c] } else { head[c].add(products[c]) };
                let sum = if last {
                    head[c]
                } else {
                    head[c].add(L::load(has, &tails[(4 * (phase + 1) + c) * tails_stride + x..]))
                };
                sum.store(&mut sums[(4 * y + c) * sums_stride + x..]);
                products[c].store(&mut tails[(4 * phase + c) * tails_stride + x..]);
            }
            phase += 1;
            if last {
                phase = 0;
                close_group::<L>(has, tails, tails_stride, x, products);
            }
        }
        for c in 0..4 {
            head[c].store(&mut heads[c * heads_stride + x..]);
        }
    }
    state.phase = (state.phase + rows) % window;
}

/// Makes tails of a group's products, its last ones given; `tails` hold four rows for each row of the group.
#[inline(always)]
fn close_group<L: Lanes>(has: L::Has, tails: &mut [f32], stride: usize, x: usize, mut sum: [L; 4]) {
    for row in (0..tails.len() / (4 * stride) - 1).rev() {
        for c in 0..4 {
            let tail = &mut tails[(4 * row + c) * stride + x..];
            sum[c] = sum[c].add(L::load(has, tail));
            sum[c].store(tail);
        }
    }
}

/// Rows that [`vertical_sums_of_seven`] does at a time.
pub(crate) const SEVEN_BLOCK: usize = 8;

dispatch! {
    /// As [`vertical_sums`] for windows of seven rows, without any state: `inputs` are rings of 16 rows whose rows `8 half
    /// ..` are new and whose other half holds the eight rows before. All eight rows of `sums` are written.
    fn vertical_sums_of_seven(inputs: [&Plane; 3], half: usize, sums: &mut Plane, width: usize) = seven_generic
}

#[inline(always)]
fn seven_generic<L: Lanes>(has: L::Has, inputs: [&Plane; 3], half: usize, sums: &mut Plane, width: usize) {
    const WINDOW: usize = 7;
    assert!(half < 2 && sums.rows() >= 4 * SEVEN_BLOCK);
    assert!(inputs.iter().all(|input| input.rows() == 2 * SEVEN_BLOCK));
    let sums_stride = sums.stride();
    let sums = sums.all_mut();
    // Row 0 is the oldest of the six before the first new one, row 6 the first new one.
    let start = SEVEN_BLOCK * (1 - half) + 2;
    for x in (0..width).step_by(L::N) {
        // Windows are the tail of rows 0 to 6 and the head of rows 7 to 13.
        let mut tails = [[L::splat(has, 0.0); 4]; WINDOW];
        let mut sum = products::<L>(has, inputs, (start + 6) % 16, x);
        tails[6] = sum;
        for i in (0..6).rev() {
            let products = products::<L>(has, inputs, (start + i) % 16, x);
            for c in 0..4 {
                sum[c] = sum[c].add(products[c]);
            }
            tails[i] = sum;
        }
        let mut head = [L::splat(has, 0.0); 4];
        for y in 0..SEVEN_BLOCK {
            if y > 0 {
                let products = products::<L>(has, inputs, (start + y + 6) % 16, x);
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
                sum.store(&mut sums[(4 * y + c) * sums_stride + x..]);
            }
        }
    }
}

/// `p1 p1`, `p1 p2`, `p1 m`, `m m` from column `x` of a row on.
#[inline(always)]
fn products<L: Lanes>(has: L::Has, [m, p1, p2]: [&Plane; 3], row: usize, x: usize) -> [L; 4] {
    let m = L::load(has, &m.all()[row * m.stride() + x..]);
    let p1 = L::load(has, &p1.all()[row * p1.stride() + x..]);
    let p2 = L::load(has, &p2.all()[row * p2.stride() + x..]);
    [p1.mul(p1), p1.mul(p2), p1.mul(m), m.mul(m)]
}
