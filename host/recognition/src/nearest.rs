//! Exact nearest pattern without comparing all. Projections on some dozen orthonormal directions and the
//! residual lengths bound distances from below; only patterns with a bound below the best distance are
//! compared. O(patterns x directions).

use super::model::squared_between;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};

const DIRECTIONS: usize = 64;
/// Fewer patterns are compared directly.
const WORTH_IT: usize = 256;
const ROUNDING: f32 = 1e-4;

/// Patterns (rows) with their projections.
#[derive(Clone, Debug)]
pub struct Nearest<'a> {
    patterns: ArrayView2<'a, f32>,
    /// Orthonormal rows of pattern width; empty for few patterns.
    directions: Array2<f32>,
    projected: Array2<f32>,
    outside: Vec<f32>,
}

impl<'a> Nearest<'a> {
    /// O(patterns x width x directions).
    pub fn new(patterns: ArrayView2<'a, f32>) -> Self {
        let directions = if patterns.nrows() < WORTH_IT {
            Array2::zeros((0, patterns.ncols()))
        } else {
            orthonormal(patterns, DIRECTIONS)
        };
        let projected = patterns.dot(&directions.t());
        let rows = patterns.rows().into_iter().zip(projected.rows());
        let outside = rows.map(|(row, inside)| rest(row, inside)).collect();
        Self { patterns, directions, projected, outside }
    }

    /// Squared distance to the nearest pattern; infinite without any.
    pub fn squared_distance(&self, query: ArrayView1<f32>) -> f32 {
        let query = query.as_standard_layout();
        let exact = |row: usize| squared_between(self.patterns.row(row), query.view());
        if self.directions.is_empty() {
            return (0..self.patterns.nrows()).map(exact).fold(f32::INFINITY, f32::min);
        }
        let inside: Array1<f32> = self.directions.dot(&query);
        let outside = rest(query.view(), inside.view());
        let bounds: Vec<f32> = self
            .projected
            .rows()
            .into_iter()
            .zip(&self.outside)
            .map(|(row, own)| squared_between(row, inside.view()) + (own - outside).powi(2))
            .collect();
        let likeliest =
            (0..bounds.len()).fold(0, |best, row| if bounds[row] < bounds[best] { row } else { best });
        let mut smallest = exact(likeliest);
        for (row, bound) in bounds.iter().enumerate() {
            if bound * (1.0 - ROUNDING) < smallest {
                smallest = smallest.min(exact(row));
            }
        }
        smallest
    }
}

fn rest(row: ArrayView1<f32>, inside: ArrayView1<f32>) -> f32 {
    (row.iter().map(|v| v * v).sum::<f32>() - inside.dot(&inside)).max(0.0).sqrt()
}

/// Orthonormal directions from evenly sampled patterns (Gram-Schmidt, twice).
fn orthonormal(patterns: ArrayView2<f32>, count: usize) -> Array2<f32> {
    let mut found: Vec<Array1<f32>> = Vec::with_capacity(count);
    for n in 0..count {
        let mut direction = patterns.row((2 * n + 1) * patterns.nrows() / (2 * count)).to_owned();
        let before = direction.dot(&direction).sqrt();
        for _ in 0..2 {
            for other in &found {
                let along = direction.dot(other);
                direction.scaled_add(-along, other);
            }
        }
        let length = direction.dot(&direction).sqrt();
        if length > 1e-3 * before.max(1e-6) {
            found.push(direction / length);
        }
    }
    let rows: Vec<_> = found.iter().map(|row| row.view().insert_axis(Axis(0))).collect();
    ndarray::concatenate(Axis(0), &rows).unwrap_or_else(|_| Array2::zeros((0, patterns.ncols())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn it_is_the_nearest_of_all() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        for (count, width) in [(0, 5), (40, 9), (700, 90), (300, 20)] {
            let patterns =
                Array2::from_shape_simple_fn((count, width), || rng.random_range(0.0..1.0_f32).powi(3));
            let nearest = Nearest::new(patterns.view());
            for _ in 0..20 {
                let query = Array1::from_shape_simple_fn(width, || rng.random_range(0.0..1.0_f32).powi(3));
                let all = patterns.rows().into_iter().map(|row| (&row - &query).mapv(|v| v * v).sum());
                let expected = all.fold(f32::INFINITY, f32::min);
                let found = nearest.squared_distance(query.view());
                assert!(
                    found == expected || (found - expected).abs() < 1e-5 * expected,
                    "{found} {expected}"
                );
            }
        }
    }
}
