//! Row-by-row search for the pattern that fits best.
//!
//! Row sums of `|Ui - Uc|` over the window's width, and the patterns' values, are stored for the last 2N + 1 rows of
//! every pattern (2 M (2N + 1) rows of floats: 370 KiB for M = 24, N = 1 and 640 columns, which fits the cache); their
//! sum over rows is the residual. The loops over M have no branches, so that the compiler vectorises them along rows.
//! The neighbours' residuals are summed again afterwards, once per pixel.

use farnear_maths::clsf::DepthScale;
use ndarray::ArrayViewMut2;

use crate::corrections::pattern::inside;

pub(super) struct Patterns<'a> {
    /// mm, `[pattern][row of the grid][column]`.
    pub values: &'a [f32],
    pub true_mm: &'a [f32],
    pub width: usize,
    pub rows: usize,
    pub grid_px: usize,
}

impl Patterns<'_> {
    fn around(&self, pattern: usize, row: usize) -> (&[f32], &[f32], f32) {
        let point = row / self.grid_px;
        let part = (row % self.grid_px) as f32 / self.grid_px as f32;
        let at = |point: usize| {
            let start = (pattern * self.rows + point.min(self.rows - 1)) * self.width;
            &self.values[start..start + self.width]
        };
        (at(point), at(point + 1), part)
    }
}

pub(super) fn correct(
    mut depth_mm: ArrayViewMut2<f32>,
    patterns: &Patterns<'_>,
    window: usize,
    scale: DepthScale,
) {
    let (height, width) = depth_mm.dim();
    let mut ring = Ring::new(2 * window + 1, patterns.true_mm.len(), width);
    let mut differences = vec![0.0_f32; width + 2 * window];
    let mut nearest =
        Nearest { residual: vec![0.0; width], least: vec![0.0; width], index: vec![0.0; width] };
    for row in 0..height + window {
        let slot = row % ring.slots;
        if row < height {
            let depths = depth_mm.row(row);
            let Some(depths) = depths.as_slice() else { return };
            for pattern in 0..ring.patterns {
                let (above, below, part) = patterns.around(pattern, row);
                let (values, sums) = ring.rows_mut(slot, pattern);
                let inner = &mut differences[window..window + width];
                absolute_differences(inner, values, depths, above, below, part);
                sum_windows(sums, &differences, window);
            }
        } else {
            (0..ring.patterns).for_each(|pattern| ring.rows_mut(slot, pattern).1.fill(0.0));
        }
        if let Some(row) = row.checked_sub(window) {
            nearest.search(&ring);
            let mut depths = depth_mm.row_mut(row);
            let Some(depths) = depths.as_slice_mut() else { return };
            cancel(depths, &nearest, &ring, row % ring.slots, patterns.true_mm, scale);
        }
    }
}

/// `[slot][pattern][column]`.
struct Ring {
    slots: usize,
    patterns: usize,
    width: usize,
    values: Vec<f32>,
    sums: Vec<f32>,
}

impl Ring {
    fn new(slots: usize, patterns: usize, width: usize) -> Self {
        let rows = || vec![0.0; slots * patterns * width];
        Self { slots, patterns, width, values: rows(), sums: rows() }
    }

    fn start(&self, slot: usize, pattern: usize) -> usize {
        (slot * self.patterns + pattern) * self.width
    }

    fn rows_mut(&mut self, slot: usize, pattern: usize) -> (&mut [f32], &mut [f32]) {
        let start = self.start(slot, pattern);
        let row = start..start + self.width;
        (&mut self.values[row.clone()], &mut self.sums[row])
    }

    fn sums(&self, slot: usize, pattern: usize) -> &[f32] {
        let start = self.start(slot, pattern);
        &self.sums[start..start + self.width]
    }

    fn value(&self, slot: usize, pattern: usize, column: usize) -> f32 {
        self.values[self.start(slot, pattern) + column]
    }

    fn residual(&self, pattern: usize, column: usize) -> f32 {
        (0..self.slots).map(|slot| self.sums[self.start(slot, pattern) + column]).sum()
    }
}

/// `|depth - pattern|`, and the pattern's values; a hole gives 0 for all patterns.
fn absolute_differences(
    out: &mut [f32],
    values: &mut [f32],
    depths: &[f32],
    above: &[f32],
    below: &[f32],
    part: f32,
) {
    let columns = out.iter_mut().zip(values).zip(depths).zip(above).zip(below);
    for ((((out, value), depth), above), below) in columns {
        *value = above + part * (below - above);
        let difference = (depth - *value).abs();
        *out = if depth.is_nan() { 0.0 } else { difference };
    }
}

/// Sums over 2N + 1 columns; `padded` has N zeros on either side.
fn sum_windows(out: &mut [f32], padded: &[f32], window: usize) {
    let width = out.len();
    if window == 1 {
        for (out, three) in out.iter_mut().zip(padded.windows(3)) {
            *out = three[0] + three[1] + three[2];
        }
        return;
    }
    out.copy_from_slice(&padded[..width]);
    for shift in 1..=2 * window {
        for (out, value) in out.iter_mut().zip(&padded[shift..shift + width]) {
            *out += value;
        }
    }
}

struct Nearest {
    residual: Vec<f32>,
    least: Vec<f32>,
    /// As a float, so that the loop has one kind of lane; -1 where no residual is finite.
    index: Vec<f32>,
}

impl Nearest {
    fn search(&mut self, ring: &Ring) {
        self.least.fill(f32::INFINITY);
        self.index.fill(-1.0);
        for pattern in 0..ring.patterns {
            let number = pattern as f32;
            let keep = |residual: f32, least: &mut f32, index: &mut f32| {
                let better = residual < *least;
                *index = if better { number } else { *index };
                *least = if better { residual } else { *least };
            };
            let columns = self.least.iter_mut().zip(&mut self.index);
            if ring.slots == 3 {
                let (a, b, c) = (ring.sums(0, pattern), ring.sums(1, pattern), ring.sums(2, pattern));
                for ((((least, index), a), b), c) in columns.zip(a).zip(b).zip(c) {
                    keep(a + b + c, least, index);
                }
            } else {
                self.residual.copy_from_slice(ring.sums(0, pattern));
                for slot in 1..ring.slots {
                    for (out, sum) in self.residual.iter_mut().zip(ring.sums(slot, pattern)) {
                        *out += sum;
                    }
                }
                for ((least, index), residual) in columns.zip(&self.residual) {
                    keep(*residual, least, index);
                }
            }
        }
    }
}

fn cancel(
    depths: &mut [f32],
    nearest: &Nearest,
    ring: &Ring,
    slot: usize,
    true_mm: &[f32],
    scale: DepthScale,
) {
    let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
    let last = ring.patterns - 1;
    for (column, depth) in depths.iter_mut().enumerate() {
        let index = nearest.index[column];
        if depth.is_nan() || index < 0.0 {
            *depth = f32::NAN;
            continue;
        }
        let index = index as usize;
        let (mut value, mut offset) = (ring.value(slot, index, column), true_mm[index]);
        if index > 0 && index < last {
            let (before, after) = (ring.residual(index - 1, column), ring.residual(index + 1, column));
            let shift = interpolate(before, nearest.least[column], after);
            let neighbour = if shift < 0.0 { index - 1 } else { index + 1 };
            value += shift.abs() * (ring.value(slot, neighbour, column) - value);
            offset += shift.abs() * (true_mm[neighbour] - offset);
        }
        *depth = inside(*depth - centre, *depth - value + offset, centre, span);
    }
}

/// Fractional index around the least residual, -1/2 to 1/2 (Li 2014, eqs. 6.5 to 6.10): the line through it and its
/// larger neighbour meets a line of opposite slope through the other one. Whole at the first and the last pattern.
fn interpolate(before: f32, least: f32, after: f32) -> f32 {
    let (larger, smaller, toward_smaller) =
        if after >= before { (after, before, -1.0) } else { (before, after, 1.0) };
    let gradient = larger - least;
    if gradient > 0.0 { toward_smaller * (gradient - (smaller - least)) / (2.0 * gradient) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Li 2014, fig. 6.2: residuals 3.2, 2.1 and 5.7 at indices 3, 4 and 5, pattern values 810 at 3 and 816 at 4.
    #[test]
    fn worked_example() {
        let index = 4.0 + interpolate(3.2, 2.1, 5.7);
        assert!((index - 3.653).abs() < 5e-4, "{index}");
        let value = 810.0 + (index - 3.0) * 6.0;
        assert!((value - 813.92).abs() < 5e-3, "{value}");
    }

    #[test]
    fn interpolation_is_symmetric() {
        assert_eq!(interpolate(5.7, 2.1, 3.2), -interpolate(3.2, 2.1, 5.7));
        assert_eq!(interpolate(2.0, 2.0, 2.0), 0.0);
        assert_eq!(interpolate(1.0, 1.0, 3.0), -0.5);
    }
}
