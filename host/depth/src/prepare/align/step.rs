//! One Gauss-Newton step of the registration, over all pixels of a level.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{BORDER_PX, Level, Model, STEP_PX, moved_row};
use crate::prepare::warp::{Warp, middle};
use crate::simd::{self, Backend, StepSums};

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

    /// Adds the sums over the row at `y`. Along it, the derivative by each parameter is the gradient times a line in `x`.
    fn add_row(&mut self, row: &StepSums, model: Model, y: f64) {
        const AXES_AND_POWERS: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];
        let [at_zero, at_one] = [0.0, 1.0].map(|x| model.basis(x, y));
        let line = |parameter: usize, axis: usize| {
            let [zero, one] = [at_zero, at_one].map(|basis| basis[parameter][axis]);
            [zero, one - zero]
        };
        for i in 0..model.parameters() {
            for (axis, power) in AXES_AND_POWERS {
                let by = line(i, axis)[power];
                self.right[i] += by * row.right[axis][power];
                for j in 0..model.parameters() {
                    for (other, other_power) in AXES_AND_POWERS {
                        self.normal[i][j] +=
                            by * line(j, other)[other_power] * row.normal[axis + other][power + other_power];
                    }
                }
            }
        }
        self.squares += row.squares;
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
        let sums = sums(level, model, warp, scale, centre, unit);
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

/// The sums of a step.
fn sums(level: &Level, model: Model, warp: &Warp, scale: f64, centre: [f64; 2], unit: f64) -> Sums {
    let (height, width) = level.far.dim();
    let step = (level.far.len() / STEP_PX).max(1);
    let rows: Vec<usize> = (BORDER_PX..height - BORDER_PX).step_by(step).collect();
    let Some(far) = level.far.as_slice() else { return Sums::NONE };
    let (backend, of_scale) = (Backend::best(), (2.4 * scale).recip() as f32);
    let of_rows = rows.par_chunks(16).map(|rows| {
        let (mut sums, mut near) = (Sums::NONE, vec![0.0; width]);
        for &y in rows {
            let inside = moved_row(&level.near, warp, y, &mut near);
            let around = [y - 1, y, y + 1].map(|row| &far[row * width..][inside.start - 1..=inside.end]);
            let place = [(inside.start as f64 - centre[0]) / unit, unit.recip()].map(|place| place as f32);
            let of_row = simd::step_row(backend, around, &near[inside.clone()], place, of_scale);
            sums.add_row(&of_row, model, (y as f64 - centre[1]) / unit);
            sums.count += inside.len() as f64;
        }
        sums
    });
    // In order, so that the sum does not depend on the threads.
    let parts: Vec<Sums> = of_rows.collect();
    parts.into_iter().fold(Sums::NONE, Sums::plus)
}
