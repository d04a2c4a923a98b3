//! One Gauss-Newton step of the registration, over all pixels of a level.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{BORDER_PX, Level, Model, MovedRow, STEP_PX};
use crate::prepare::warp::{Warp, middle};

/// Least RMS difference of the bands for the outlier limit: that of equal images is 0.
pub(super) const LEAST_SCALE: f64 = 1e-6;
/// Correlation area of the band, px.
const CORRELATED_PX: f64 = 12.0;

#[derive(Clone)]
struct Sums {
    normal: [[f64; 6]; 6],
    right: [f64; 6],
    squares: f64,
    count: f64,
}

impl Sums {
    const NONE: Self = Self { normal: [[0.0; 6]; 6], right: [0.0; 6], squares: 0.0, count: 0.0 };

    fn plus(mut self, other: Self) -> Self {
        for (row, others) in self.normal.iter_mut().zip(other.normal) {
            row.iter_mut().zip(others).for_each(|(a, b)| *a += b);
        }
        self.right.iter_mut().zip(other.right).for_each(|(a, b)| *a += b);
        self.squares += other.squares;
        self.count += other.count;
        self
    }
}

/// A Gauss-Newton step.
pub(super) struct Step {
    pub warp: Warp,
    /// RMS difference before the step.
    pub scale: f64,
    pub error: f64,
    pub largest_px: f64,
}

impl Step {
    pub fn new(level: &Level, model: Model, warp: &Warp, scale: f64) -> Option<Self> {
        let (height, width) = level.far.dim();
        let centre = middle((height, width));
        let unit = 0.5 * (height as f64).hypot(width as f64);
        let n = model.parameters();
        let sums = match model {
            Model::Shift => sums::<2>(level, warp, scale, centre, unit),
            Model::Similarity => sums::<4>(level, warp, scale, centre, unit),
            Model::Affine => sums::<6>(level, warp, scale, centre, unit),
        };
        if sums.count < 8.0 * n as f64 {
            return None;
        }
        let variance = sums.squares / sums.count;
        let normal = DMatrix::from_fn(n, n, |i, j| sums.normal[i][j]);
        let right = DVector::from_fn(n, |i, _| sums.right[i]);
        let factor = normal.cholesky()?;
        let step = factor.solve(&right);
        let covariance = factor.inverse() * (variance * CORRELATED_PX);
        if !step.iter().all(|p| p.is_finite()) {
            return None;
        }
        Some(Self {
            warp: warp.after(&model.warp(step.as_slice(), centre, unit).inverse()?),
            scale: variance.sqrt(),
            error: rms_over_field(model, &covariance, unit, (height, width)),
            largest_px: step.iter().map(|p| p.abs()).fold(0.0, f64::max),
        })
    }
}

/// RMS over the field of the displacement's standard error.
fn rms_over_field(model: Model, covariance: &DMatrix<f64>, unit: f64, size: (usize, usize)) -> f64 {
    let [x2, y2] = [size.1, size.0].map(|n| (n as f64 / unit).powi(2) / 12.0);
    let place = [x2.sqrt(), y2.sqrt()];
    let basis = model.basis(place[0], place[1]);
    let along = |axis: usize| -> f64 {
        (0..covariance.nrows()).map(|i| covariance[(i, i)] * basis[i][axis].powi(2)).sum()
    };
    (along(0) + along(1)).sqrt()
}

/// Pixels that are summed in parallel: the compiler vectorises them.
const SIDE_BY_SIDE: usize = 8;

/// Derivatives of the far image by each of `N` parameters at pixels with these gradients and places ([`Model::basis`]).
#[inline(always)]
fn jacobian<const N: usize>(
    [gx, gy]: [&[f32; SIDE_BY_SIDE]; 2],
    x: &[f32; SIDE_BY_SIDE],
    y: f32,
) -> [[f32; SIDE_BY_SIDE]; N] {
    std::array::from_fn(|parameter| {
        std::array::from_fn(|i| match (N, parameter) {
            (_, 0) => gx[i],
            (_, 1) => gy[i],
            (4, 2) => gx[i] * x[i] + gy[i] * y,
            (4, _) => gy[i] * x[i] - gx[i] * y,
            (_, 2) => gx[i] * x[i],
            (_, 3) => gx[i] * y,
            (_, 4) => gy[i] * x[i],
            (_, _) => gy[i] * y,
        })
    })
}

/// The sums of a step for a model of `N` parameters.
fn sums<const N: usize>(level: &Level, warp: &Warp, scale: f64, centre: [f64; 2], unit: f64) -> Sums {
    let (height, width) = level.far.dim();
    let step = (level.far.len() / STEP_PX).max(1);
    let rows: Vec<usize> = (BORDER_PX..height - BORDER_PX).step_by(step).collect();
    let Some(far) = level.far.as_slice() else { return Sums::NONE };
    let of_scale = (2.4 * scale).recip() as f32;
    let of_rows = rows.par_chunks(16).map(|rows| {
        let mut sums = Sums::NONE;
        for &y in rows {
            sums = sums.plus(sums_of_row::<N>(far, width, y, level, warp, of_scale, centre, unit));
        }
        sums
    });
    // In order, so that the sum does not depend on the threads.
    let parts: Vec<Sums> = of_rows.collect();
    parts.into_iter().fold(Sums::NONE, Sums::plus)
}

#[allow(clippy::too_many_arguments)] // the innermost loop
fn sums_of_row<const N: usize>(
    far: &[f32],
    width: usize,
    y: usize,
    level: &Level,
    warp: &Warp,
    of_scale: f32,
    centre: [f64; 2],
    unit: f64,
) -> Sums {
    const NONE: [f32; SIDE_BY_SIDE] = [0.0; SIDE_BY_SIDE];
    let mut normal = [[NONE; N]; N];
    let (mut right, mut squares, mut count) = ([NONE; N], NONE, 0_usize);
    let row_of_field = ((y as f64 - centre[1]) / unit) as f32;
    // Where nothing is displaced nothing is interpolated.
    let in_place = match level.near.as_slice() {
        Some(near) if *warp == Warp::IDENTITY && y + 1 + BORDER_PX < level.near.nrows() => {
            &near[y * width..(y + 1) * width - 1 - BORDER_PX]
        }
        _ => &[],
    };
    let row = MovedRow::new(&level.near, warp, y, BORDER_PX..width - BORDER_PX);
    for left in (BORDER_PX..width - BORDER_PX).step_by(SIDE_BY_SIDE) {
        let [start, end] =
            [row.inside.start, row.inside.end].map(|column| column.clamp(left, left + SIDE_BY_SIDE) - left);
        let (mut near, mut present) = (NONE, NONE);
        match in_place.get(left..left + SIDE_BY_SIDE) {
            Some(values) => near.copy_from_slice(values),
            None => (start..end).for_each(|i| near[i] = row.value(left + i)),
        }
        present[start..end].fill(1.0);
        count += end - start;
        // Beyond the row's end are pixels of the next one, without weight.
        let at = y * width + left;
        let [before, here, after, above, below] =
            [at - 1, at, at + 1, at - width, at + width].map(|from| &far[from..from + SIDE_BY_SIDE]);
        let gx: [f32; SIDE_BY_SIDE] = std::array::from_fn(|i| 0.5 * (after[i] - before[i]));
        let gy: [f32; SIDE_BY_SIDE] = std::array::from_fn(|i| 0.5 * (below[i] - above[i]));
        let difference: [f32; SIDE_BY_SIDE] = std::array::from_fn(|i| near[i] - here[i]);
        let column = std::array::from_fn(|i| (((left + i) as f64 - centre[0]) / unit) as f32);
        let weight: [f32; SIDE_BY_SIDE] = std::array::from_fn(|i| {
            let relative = difference[i] * of_scale;
            present[i] / (1.0 + relative * relative)
        });
        let jacobian = jacobian::<N>([&gx, &gy], &column, row_of_field);
        for i in 0..N {
            let weighted: [f32; SIDE_BY_SIDE] = std::array::from_fn(|x| weight[x] * jacobian[i][x]);
            for x in 0..SIDE_BY_SIDE {
                right[i][x] += weighted[x] * difference[x];
            }
            for j in i..N {
                for x in 0..SIDE_BY_SIDE {
                    normal[i][j][x] += weighted[x] * jacobian[j][x];
                }
            }
        }
        for x in 0..SIDE_BY_SIDE {
            squares[x] += weight[x] * difference[x] * difference[x];
        }
    }
    let whole = |parts: [f32; SIDE_BY_SIDE]| parts.into_iter().map(f64::from).sum::<f64>();
    let mut sums = Sums { squares: whole(squares), count: count as f64, ..Sums::NONE };
    for i in 0..N {
        sums.right[i] = whole(right[i]);
        for (j, parts) in normal[i].iter().enumerate().skip(i) {
            sums.normal[i][j] = whole(*parts);
            sums.normal[j][i] = sums.normal[i][j];
        }
    }
    sums
}
