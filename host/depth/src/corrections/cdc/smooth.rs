//! Smooths a pattern and samples it on a grid: along rows, then columns, a straight line is fitted under a Gaussian
//! weight (local linear regression), because a weighted mean would bias slopes at the borders. Holes have no weight.

use ndarray::{Array2, ArrayView2};

const REACH: f64 = 3.0;

/// SD that bridges holes without smoothing.
const BRIDGE_PX: f64 = 2.0;

pub(super) fn grid_points(length: usize, grid_px: usize) -> usize {
    (length - 1).div_ceil(grid_px) + 1
}

/// The pattern in mm on the grid (rows, columns); NaN where a grid point has no data within reach.
pub(super) fn on_grid(depth_mm: ArrayView2<f32>, sd_px: f64, grid_px: usize) -> Array2<f64> {
    let (height, width) = depth_mm.dim();
    let (rows, columns) = (grid_points(height, grid_px), grid_points(width, grid_px));
    let mut along_rows = Array2::zeros((columns, height));
    let mut line = Vec::new();
    for (row, depths) in depth_mm.outer_iter().enumerate() {
        line.clear();
        line.extend(depths.iter().map(|depth| f64::from(*depth)));
        for column in 0..columns {
            along_rows[(column, row)] = local_line(&line, column * grid_px, sd_px);
        }
    }
    let mut smoothed = Array2::zeros((rows, columns));
    for (column, values) in along_rows.outer_iter().enumerate() {
        line.clear();
        line.extend(values);
        for row in 0..rows {
            smoothed[(row, column)] = local_line(&line, row * grid_px, sd_px);
        }
    }
    smoothed
}

/// The line fitted to `values` under a Gaussian weight around `at`, evaluated at `at` (may exceed the last index).
fn local_line(values: &[f64], at: usize, sd_px: f64) -> f64 {
    let here = values.get(at).copied().unwrap_or(f64::NAN);
    if sd_px == 0.0 && here.is_finite() {
        return here;
    }
    let sd_px = if sd_px == 0.0 { BRIDGE_PX } else { sd_px };
    let reach = (REACH * sd_px).ceil() as usize;
    let (mut s0, mut s1, mut s2, mut t0, mut t1) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let start = at.saturating_sub(reach);
    for (index, value) in values.iter().enumerate().take(at + reach + 1).skip(start) {
        if value.is_finite() {
            let offset = index as f64 - at as f64;
            let weight = (-0.5 * (offset / sd_px).powi(2)).exp();
            s0 += weight;
            s1 += weight * offset;
            s2 += weight * offset * offset;
            t0 += weight * value;
            t1 += weight * offset * value;
        }
    }
    let determinant = s0 * s2 - s1 * s1;
    if determinant > 1e-6 * s0 * s0 {
        (t0 * s2 - t1 * s1) / determinant
    } else if s0 > 0.0 {
        t0 / s0
    } else {
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_with_holes_comes_out_as_itself_also_at_the_borders() {
        let plane = |row: f64, column: f64| 900.0 + 0.1 * column - 0.05 * row;
        let mut depth =
            Array2::from_shape_fn((50, 63), |(row, column)| plane(row as f64, column as f64) as f32);
        for hole in 20..26 {
            depth[(hole, 30)] = f32::NAN;
        }
        for (sd_px, grid_px) in [(8.0, 4), (0.0, 1)] {
            let smoothed = on_grid(depth.view(), sd_px, grid_px);
            assert_eq!(smoothed.dim(), (grid_points(50, grid_px), grid_points(63, grid_px)));
            for ((row, column), value) in smoothed.indexed_iter() {
                let expected = plane((row * grid_px) as f64, (column * grid_px) as f64);
                assert!((value - expected).abs() < 2e-4, "{row} {column}: {value} {expected}");
            }
        }
    }

    #[test]
    fn noise_decreases_as_predicted() {
        // White noise of SD 1 under a Gaussian of SD s keeps 1 / (2 s sqrt(pi)); a pseudo-random sign suffices.
        let mut state = 1_u32;
        let noise = Array2::from_shape_fn((200, 200), |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if state >> 31 == 0 { 1.0 } else { -1.0 }
        });
        let smoothed = on_grid(noise.view(), 4.0, 2);
        let inner = smoothed.slice(ndarray::s![10..90, 10..90]);
        let sd = inner.mapv(|v| v * v).mean().unwrap().sqrt();
        let theory = 1.0 / (2.0 * 4.0 * std::f64::consts::PI.sqrt());
        // 160 x 160 px hold about 500 independent values: 3 % statistical.
        assert!((sd / theory - 1.0).abs() < 0.12, "{sd} {theory}");
    }
}
