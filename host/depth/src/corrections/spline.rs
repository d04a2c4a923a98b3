//! Correction of a measured depth by a smooth surface over field and depth: a tensor-product cubic B-spline.
//!
//! `t - u = sum c(i, j, k) B_i(x) B_j(y) B_k(u)` with uniform knots, fitted by penalised least squares (P-splines;
//! Eilers & Marx 1996): second differences of neighbouring coefficients along each axis are penalised, so that noise is
//! not followed and sparse parts are bridged straight. Unlike one polynomial it follows the lens locally without
//! oscillating elsewhere; unlike stored patterns it adds no noise. Beyond the patterns' depths the penalty continues it
//! straight up to the scale's ends; beyond these the result is NaN. The field is not extrapolated: each cell needs
//! samples at [`Learned::PATTERNS_NEEDED`] depths. Samples are means over small blocks: noise is correlated over a
//! smoothing window, and less noise in `u` flattens the fit less. 343 coefficients.

use farnear_maths::clsf::DepthScale;
use nalgebra::{DMatrix, DVector};
use ndarray::{ArrayViewMut2, s};
use serde::{Deserialize, Serialize};

use super::pattern::{Series, coordinate, inside, normalise};
use super::table::Learned;
use super::{CdcSettings, CorrectionError};

/// Knot intervals along a side of the field, and along depth.
const FIELD_INTERVALS: usize = 4;
const DEPTH_INTERVALS: usize = 4;

/// Weight of the squared second differences against the mean squared error of the samples.
const PENALTY: f64 = 1e-4;

const BLOCKS: usize = 60;

/// Accepted numbers of coefficients along an axis of a file.
const COUNTS: std::ops::RangeInclusive<usize> = 4..=67;

/// The coefficients `[row][column][depth]`, in units of half the depth scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Spline {
    rows: usize,
    columns: usize,
    depths: usize,
    coefficients: Vec<f64>,
}

/// The cubic B-splines that are not zero at a place: index of the first, and all four values.
#[derive(Clone, Copy)]
struct Basis<T> {
    first: usize,
    values: [T; 4],
}

/// Basis of `count` splines on uniform knots over -1 to 1.
fn basis(place: f64, count: usize) -> Basis<f64> {
    let intervals = count - 3;
    let position = 0.5 * (place + 1.0) * intervals as f64;
    let first = (position as usize).min(intervals - 1);
    let t = position - first as f64;
    let (square, cube, rest) = (t * t, t * t * t, 1.0 - t);
    let values = [rest * rest * rest, 3.0 * cube - 6.0 * square + 4.0, 3.0 * (square - cube + t) + 1.0, cube];
    Basis { first, values: values.map(|value| value / 6.0) }
}

/// A block of a pattern: place, measured depth, correction, and number of pixels.
struct Sample {
    y: f64,
    x: f64,
    u: f64,
    add: f64,
    weight: f64,
}

fn samples(series: &Series<'_>) -> Vec<(usize, Sample)> {
    let ((height, width), scale) = (series.dim(), series.scale());
    let side = (height.min(width) / BLOCKS).max(1);
    let mut samples = Vec::new();
    for (index, pattern) in series.patterns().iter().enumerate() {
        let truth = normalise(scale, pattern.true_mm);
        for top in (0..height).step_by(side) {
            for left in (0..width).step_by(side) {
                let (bottom, right) = ((top + side).min(height), (left + side).min(width));
                let block = pattern.depth_mm.slice(s![top..bottom, left..right]);
                let (mut y, mut x, mut u, mut weight) = (0.0, 0.0, 0.0, 0.0);
                for ((row, column), depth) in block.indexed_iter().filter(|(_, depth)| depth.is_finite()) {
                    y += coordinate(top + row, height);
                    x += coordinate(left + column, width);
                    u += normalise(scale, f64::from(*depth));
                    weight += 1.0;
                }
                let [y, x, u] = [y, x, u].map(|sum| sum / weight);
                // Values beyond the scale are NaN when corrected.
                if u.abs() <= 1.0 {
                    samples.push((index, Sample { y, x, u, add: truth - u, weight }));
                }
            }
        }
    }
    samples
}

struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    weight: f64,
}

impl Normal {
    fn new(unknowns: usize) -> Self {
        Self { matrix: DMatrix::zeros(unknowns, unknowns), right: DVector::zeros(unknowns), weight: 0.0 }
    }

    fn add(&mut self, sample: &Sample, [rows, columns, depths]: [usize; 3]) {
        let [of_y, of_x, of_u] = [basis(sample.y, rows), basis(sample.x, columns), basis(sample.u, depths)];
        let mut terms = [(0, 0.0); 64];
        let places = (0..4).flat_map(|i| (0..4).flat_map(move |j| (0..4).map(move |k| (i, j, k))));
        for (term, (i, j, k)) in terms.iter_mut().zip(places) {
            let index = ((of_y.first + i) * columns + of_x.first + j) * depths + of_u.first + k;
            *term = (index, of_y.values[i] * of_x.values[j] * of_u.values[k]);
        }
        for (at, (column, value)) in terms.iter().enumerate() {
            let weighted = sample.weight * value;
            self.right[*column] += weighted * sample.add;
            let mut of_column = self.matrix.column_mut(*column);
            for (row, value) in &terms[at..] {
                of_column[*row] += weighted * value;
            }
        }
        self.weight += sample.weight;
    }

    fn solve(mut self, counts: [usize; 3]) -> Option<Vec<f64>> {
        self.matrix /= self.weight;
        self.right /= self.weight;
        add_penalty(&mut self.matrix, counts);
        self.matrix.fill_upper_triangle_with_lower_triangle();
        let factor = self.matrix.cholesky()?;
        let solution = factor.solve(&self.right);
        solution.iter().all(|c| c.is_finite()).then(|| solution.as_slice().to_vec())
    }
}

fn add_penalty(matrix: &mut DMatrix<f64>, counts: [usize; 3]) {
    let [rows, columns, depths] = counts;
    let strides = [columns * depths, depths, 1];
    for index in 0..rows * columns * depths {
        let places = [index / strides[0], index / strides[1] % columns, index % depths];
        for axis in 0..3 {
            if places[axis] + 2 >= counts[axis] {
                continue;
            }
            let difference = [0, 1, 2].map(|i| index + i * strides[axis]).into_iter().zip([1.0, -2.0, 1.0]);
            for (row, of_row) in difference.clone() {
                for (column, of_column) in difference.clone().filter(|(column, _)| *column <= row) {
                    matrix[(row, column)] += PENALTY * of_row * of_column;
                }
            }
        }
    }
}

fn check_field(samples: &[(usize, Sample)]) -> Result<(), CorrectionError> {
    let cell =
        |place: f64| ((0.5 * (place + 1.0) * FIELD_INTERVALS as f64) as usize).min(FIELD_INTERVALS - 1);
    let mut seen = vec![(0, 0, usize::MAX); FIELD_INTERVALS * FIELD_INTERVALS];
    for (pattern, sample) in samples {
        let (pixels, patterns, last) = &mut seen[cell(sample.y) * FIELD_INTERVALS + cell(sample.x)];
        *pixels += sample.weight as usize;
        *patterns += usize::from(last != pattern);
        *last = *pattern;
    }
    let blind = seen.iter().position(|(_, patterns, _)| *patterns < Spline::PATTERNS_NEEDED);
    blind.map_or(Ok(()), |index| {
        let (i, j) = (index / FIELD_INTERVALS, index % FIELD_INTERVALS);
        Err(CorrectionError::Underdetermined {
            what: format!("the field in row {i}, column {j} of {FIELD_INTERVALS}x{FIELD_INTERVALS}"),
            samples: seen[index].0,
            terms: Spline::PATTERNS_NEEDED,
        })
    })
}

impl Learned for Spline {
    // As for `clsf`: where depths are bridged straight, so many distinguish a bend from noise.
    const PATTERNS_NEEDED: usize = 4;

    fn learn(series: &Series<'_>, _: &CdcSettings) -> Result<Self, CorrectionError> {
        let samples = samples(series);
        check_field(&samples)?;
        let counts = [FIELD_INTERVALS + 3, FIELD_INTERVALS + 3, DEPTH_INTERVALS + 3];
        let unknowns = counts.iter().product();
        let mut normal = Normal::new(unknowns);
        for (_, sample) in &samples {
            normal.add(sample, counts);
        }
        let coefficients = normal.solve(counts).ok_or_else(|| CorrectionError::Underdetermined {
            what: "the surface over field and depth".to_owned(),
            samples: samples.len(),
            terms: unknowns,
        })?;
        let [rows, columns, depths] = counts;
        Ok(Self { rows, columns, depths, coefficients })
    }

    fn prepare(&mut self, _: (usize, usize)) -> Result<(), CorrectionError> {
        let Self { rows, columns, depths, coefficients } = self;
        let counts = [*rows, *columns, *depths];
        if !counts.iter().all(|count| COUNTS.contains(count)) {
            return Err(CorrectionError::Damaged(format!("a spline of {counts:?} coefficients")));
        }
        let expected: usize = counts.iter().product();
        if coefficients.len() != expected || !coefficients.iter().all(|c| c.is_finite()) {
            let found = coefficients.len();
            return Err(CorrectionError::Damaged(format!(
                "{found} coefficients of a spline where {expected} finite ones are needed"
            )));
        }
        Ok(())
    }

    fn apply(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        let span = f64::from(scale.half_span_mm());
        let of_columns: Vec<Basis<f32>> = (0..width)
            .map(|column| {
                let Basis { first, values } = basis(coordinate(column, width), self.columns);
                Basis { first, values: values.map(|value| value as f32) }
            })
            .collect();
        let mut along_row = vec![0.0; self.columns * self.depths];
        for (row, mut depths) in depth_mm.outer_iter_mut().enumerate() {
            let of_row = basis(coordinate(row, height), self.rows);
            for (index, sum) in along_row.iter_mut().enumerate() {
                let at =
                    |i: usize| self.coefficients[(of_row.first + i) * self.columns * self.depths + index];
                *sum = (span * (0..4).map(|i| of_row.values[i] * at(i)).sum::<f64>()) as f32;
            }
            if let Some(depths) = depths.as_slice_mut() {
                correct_row(depths, &of_columns, &along_row, self.depths, scale);
            }
        }
    }
}

/// The hot loop. `along_row` are the coefficients of one map row in mm, `[column][depth]`.
fn correct_row(
    depths: &mut [f32],
    of_columns: &[Basis<f32>],
    along_row: &[f32],
    count: usize,
    scale: DepthScale,
) {
    let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
    let intervals = count - 3;
    let per_mm = 0.5 * intervals as f32 / span;
    for (depth, of_column) in depths.iter_mut().zip(of_columns) {
        let d = *depth - centre;
        let position = (d + span) * per_mm;
        // A depth that is not finite or beyond the scale becomes NaN below, for every interval.
        let first = (position as usize).min(intervals - 1);
        let t = position - first as f32;
        let (square, cube, rest) = (t * t, t * t * t, 1.0 - t);
        let of_depth =
            [rest * rest * rest, 3.0 * cube - 6.0 * square + 4.0, 3.0 * (square - cube + t) + 1.0, cube];
        let mut add = 0.0;
        for (i, of_column_i) in of_column.values.iter().enumerate() {
            let at = (of_column.first + i) * count + first;
            let along = &along_row[at..at + 4];
            let sum = of_depth[0] * along[0]
                + of_depth[1] * along[1]
                + of_depth[2] * along[2]
                + of_depth[3] * along[3];
            add += of_column_i * sum;
        }
        *depth = inside(d, *depth + add * (1.0 / 6.0), centre, span);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_splines_add_up_to_one_and_are_smooth() {
        for count in [4, 7, 9] {
            let value = |place: f64, index: usize| {
                let found = basis(place, count);
                index.checked_sub(found.first).and_then(|i| found.values.get(i)).copied().unwrap_or(0.0)
            };
            for i in 0..=200 {
                let place = f64::from(i) / 100.0 - 1.0;
                let sum: f64 = (0..count).map(|index| value(place, index)).sum();
                assert!((sum - 1.0).abs() < 1e-12, "{place}: {sum}");
            }
            // Value and slope are continuous at every inner knot.
            for knot in 1..count - 3 {
                let at = 2.0 * knot as f64 / (count - 3) as f64 - 1.0;
                for index in 0..count {
                    let [a, b, c] = [at - 1e-6, at, at + 1e-6].map(|place| value(place, index));
                    assert!((a - c).abs() < 1e-5 && (a - 2.0 * b + c).abs() < 1e-10, "{index} at {at}");
                }
            }
        }
    }

    #[test]
    fn the_penalty_leaves_what_is_straight_along_each_axis() {
        let counts = [5, 4, 6];
        let mut matrix = DMatrix::zeros(120, 120);
        add_penalty(&mut matrix, counts);
        matrix.fill_upper_triangle_with_lower_triangle();
        let of = |f: fn(f64, f64, f64) -> f64| {
            DVector::from_fn(120, |i, _| f((i / 24) as f64, (i / 6 % 4) as f64, (i % 6) as f64))
        };
        let straight = of(|y, x, u| 1.0 + y - 2.0 * x + 0.5 * u + x * y - u * y + 0.1 * x * y * u);
        assert!((&matrix * &straight).amax() < 1e-12);
        for bent in [of(|y, _, _| y * y), of(|_, x, _| x * x), of(|_, _, u| u * u)] {
            assert!((bent.transpose() * &matrix * &bent)[0] > PENALTY);
        }
    }
}
