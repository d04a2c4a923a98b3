//! Regions filled as in Li 2014, section 6.5: one after the other, each from the rectangle around it. All regions are
//! cleared first. Then each, in reading order of its first pixel, fits the polynomial `1, x, x^2, x^3, y, y^2, y^3`
//! (eq. 6.16) by least squares to the values within its bounding rectangle plus one pixel, including earlier fillings.
//! The thesis has no mixed terms, no weights and no wider margin.

use nalgebra::{SMatrix, SVector};
use ndarray::Array2;

const TERMS: usize = 7;

/// Fills the region's NaN pixels of `depth_mm`; false if there were too few values.
pub(super) fn fill_region(depth_mm: &mut Array2<f32>, region: &[(usize, usize)]) -> bool {
    let (height, width) = depth_mm.dim();
    let range = |of: fn(&(usize, usize)) -> usize, length: usize| {
        let [low, high] = [region.iter().map(of).min(), region.iter().map(of).max()].map(|v| v.unwrap_or(0));
        low.saturating_sub(1)..(high + 2).min(length)
    };
    let (rows, columns) = (range(|p| p.0, height), range(|p| p.1, width));
    // Within [-1, 1], so that powers stay comparable.
    let place = |at: usize, range: &std::ops::Range<usize>| {
        let half = 0.5 * (range.len().max(2) - 1) as f64;
        (at as f64 - range.start as f64 - half) / half
    };
    let terms = |y: usize, x: usize| {
        let [y, x] = [place(y, &rows), place(x, &columns)];
        SVector::<f64, TERMS>::from([1.0, x, x * x, x * x * x, y, y * y, y * y * y])
    };
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut rhs = SVector::<f64, TERMS>::zeros();
    let mut mean = (0.0, 0.0_f64);
    let samples: Vec<_> = rows
        .clone()
        .flat_map(|y| columns.clone().map(move |x| (y, x)))
        .filter(|at| depth_mm[*at].is_finite())
        .map(|(y, x)| (terms(y, x), f64::from(depth_mm[(y, x)])))
        .collect();
    if samples.len() < TERMS {
        return false;
    }
    for (_, depth) in &samples {
        mean = (mean.0 + depth, mean.1 + 1.0);
    }
    let mean = mean.0 / mean.1;
    for (row, depth) in &samples {
        normal += row * row.transpose();
        rhs += row * (depth - mean);
    }
    // A small ridge: in a rectangle two pixels wide the powers depend on each other.
    for i in 0..TERMS {
        normal[(i, i)] += 1e-9 * samples.len() as f64;
    }
    let Some(coefficients) = normal.cholesky().map(|factors| factors.solve(&rhs)) else { return false };
    for (y, x) in region {
        depth_mm[(*y, *x)] = (mean + terms(*y, *x).dot(&coefficients)) as f32;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(low: (usize, usize), high: (usize, usize)) -> Vec<(usize, usize)> {
        (low.0..high.0).flat_map(|y| (low.1..high.1).map(move |x| (y, x))).collect()
    }

    #[test]
    fn a_surface_without_mixed_terms_is_restored_and_one_with_them_is_not() {
        for (mixed, least, largest) in [(0.0, 0.0, 2e-3), (0.01, 0.05, 1.0)] {
            let surface = |y: f32, x: f32| {
                900.0 + 0.1 * x - 0.05 * y + 1e-3 * x * x + 1e-5 * y * y * y + mixed * (x - 20.0) * (y - 20.0)
            };
            let mut map = Array2::from_shape_fn((40, 40), |(y, x)| surface(y as f32, x as f32));
            let region = region((10, 12), (20, 26));
            region.iter().for_each(|at| map[*at] = f32::NAN);
            assert!(fill_region(&mut map, &region));
            let error = |&(y, x): &(usize, usize)| (map[(y, x)] - surface(y as f32, x as f32)).abs();
            let worst = region.iter().map(error).fold(0.0, f32::max);
            assert!((least..largest).contains(&worst), "{worst}");
        }
    }

    /// A region that fills the map except a corner: six values do not determine seven terms.
    #[test]
    fn too_little_around_leaves_a_region_empty() {
        let mut map = Array2::from_elem((8, 8), f32::NAN);
        map.slice_mut(ndarray::s![0..2, 0..3]).fill(900.0);
        let region: Vec<_> = map.indexed_iter().filter(|(_, d)| d.is_nan()).map(|(at, _)| at).collect();
        assert!(!fill_region(&mut map, &region));
        assert_eq!(map.iter().filter(|d| d.is_nan()).count(), 58);
    }
}
