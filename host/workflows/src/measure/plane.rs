//! The plane through the depths of a region.

use std::path::Path;

use farnear_files::map;
use serde::Serialize;

use super::{Region, nothing, part, standard_error};
use crate::{error::Result, figures::rounded};

/// Rounds of reweighting: outliers get Huber's weights.
const ROUNDS: usize = 6;

/// A plane, and how far depths lie from it.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PlaneFigures {
    /// Pixels with a depth.
    pub pixels: usize,
    /// Pixels without.
    pub missing: usize,
    /// Depth of the plane in the region's middle.
    pub depth_mm: f64,
    /// Its standard error.
    pub standard_error_mm: f64,
    /// Change of depth to the right.
    pub slope_x_mm_per_px: f64,
    /// Change of depth downwards.
    pub slope_y_mm_per_px: f64,
    /// Root mean square distance of the depths from the plane.
    pub rms_mm: f64,
    /// The same of 95 % of the pixels: largest distance.
    pub p95_mm: f64,
}

/// Fits a plane to a region of a map, or to all of it, robustly.
///
/// # Errors
/// As [`region`](super::region).
pub fn plane(depth: &Path, region: Option<Region>) -> Result<PlaneFigures> {
    let map = map::read(depth)?;
    let part = part(&map, region, depth)?;
    let (height, width) = part.dim();
    let (middle_x, middle_y) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
    let samples: Vec<[f64; 3]> = part
        .indexed_iter()
        .filter(|(_, value)| value.is_finite())
        .map(|((y, x), value)| [x as f64 - middle_x, y as f64 - middle_y, f64::from(*value)])
        .collect();
    let (Some(first), true) = (samples.first(), samples.len() > 3) else { return Err(nothing(depth)) };
    let mut fitted = [first[2], 0.0, 0.0];
    let mut limit = f64::INFINITY;
    for _ in 0..ROUNDS {
        let weight = |distance: f64| (limit / distance.abs().max(1e-12)).min(1.0);
        let Some(found) = solve(&samples, &fitted, weight) else { return Err(nothing(depth)) };
        fitted = found;
        let mut sizes: Vec<f64> = samples.iter().map(|sample| distance(sample, &fitted).abs()).collect();
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        limit = (1.5 * 1.4826 * median).max(1e-9);
    }
    let mut sizes: Vec<f64> = samples.iter().map(|sample| distance(sample, &fitted).abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let rms = (sizes.iter().map(|size| size * size).sum::<f64>() / sizes.len() as f64).sqrt();
    let mut left = part.to_owned();
    for ((y, x), value) in left.indexed_iter_mut() {
        let sample = [x as f64 - middle_x, y as f64 - middle_y, f64::from(*value)];
        *value = distance(&sample, &fitted) as f32;
    }
    let mm = |value: f64| rounded(value, 4);
    Ok(PlaneFigures {
        pixels: samples.len(),
        missing: part.len() - samples.len(),
        depth_mm: mm(fitted[0]),
        standard_error_mm: mm(standard_error(left.view())),
        slope_x_mm_per_px: rounded(fitted[1], 6),
        slope_y_mm_per_px: rounded(fitted[2], 6),
        rms_mm: mm(rms),
        p95_mm: mm(sizes[(0.95 * (sizes.len() - 1) as f64).round() as usize]),
    })
}

fn distance([x, y, depth]: &[f64; 3], [a, b, c]: &[f64; 3]) -> f64 {
    depth - (a + b * x + c * y)
}

/// Weighted least squares by Cramer's rule; weights follow from the distance to the plane before.
fn solve(samples: &[[f64; 3]], before: &[f64; 3], weight: impl Fn(f64) -> f64) -> Option<[f64; 3]> {
    let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
    for sample in samples {
        let w = weight(distance(sample, before));
        let terms = [1.0, sample[0], sample[1]];
        for (row, term) in normal.iter_mut().zip(terms) {
            row.iter_mut().zip(terms).for_each(|(sum, other)| *sum += w * term * other);
        }
        right.iter_mut().zip(terms).for_each(|(sum, term)| *sum += w * term * sample[2]);
    }
    let determinant = |m: &[[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(&normal);
    if !(whole.is_finite() && whole > 0.0) {
        return None;
    }
    Some(std::array::from_fn(|column| {
        let mut replaced = normal;
        replaced.iter_mut().zip(right).for_each(|(row, value)| row[column] = value);
        determinant(&replaced) / whole
    }))
}
