//! Landmark Isomap (de Silva and Tenenbaum, NIPS 15, 2003) for large galleries: scales the paths from some
//! landmarks and places other samples by their distances to them. Farthest-point steps over the path lengths
//! choose landmarks that cover the data. L N floats instead of N^2; 20,000 samples of 360 numbers take
//! seconds, mostly for the neighbour search.

use super::geodesic::{dijkstra, from_sources};
use super::isomap::classical_scaling;
use super::neighbours::Graph;
use super::{EmbeddingError, check};
use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;

/// Layout of a gallery by landmarks.
#[derive(Clone, Debug, PartialEq)]
pub struct LandmarkIsomap {
    /// One row per sample, one column per dimension.
    pub coordinates: Array2<f32>,
    /// Sample rows of the landmarks.
    pub landmarks: Vec<usize>,
    /// Descending eigenvalues.
    pub eigenvalues: Vec<f64>,
}

/// Fails as [`super::isomap::isomap`] does, and for fewer landmarks than dimensions + 2.
pub fn landmark_isomap(
    samples: ArrayView2<f32>,
    neighbours: usize,
    landmarks: usize,
    dimensions: usize,
) -> Result<LandmarkIsomap, EmbeddingError> {
    check(samples, dimensions + 2)?;
    let count = landmarks.min(samples.nrows());
    if count < dimensions + 2 {
        return Err(EmbeddingError::Shape {
            what: "number of landmarks (at least two more than dimensions)",
            expected: dimensions + 2,
            found: landmarks,
        });
    }
    let graph = Graph::new(samples, neighbours)?;
    graph.connected(neighbours)?;
    let chosen = spread(&graph, count);
    let paths = from_sources(&graph, &chosen);
    let between = Array2::from_shape_fn((count, count), |(i, j)| paths[[i, chosen[j]]]);
    let (landmark_coordinates, eigenvalues) = classical_scaling(&between, dimensions)?;
    // Triangulation: y = -1/2 L# (delta - mean delta), with L# the rows v_k^T / sqrt(lambda_k) =
    // coordinate_k^T / lambda_k.
    let mean: Vec<f64> = between
        .rows()
        .into_iter()
        .map(|row| row.iter().map(|d| f64::from(*d).powi(2)).sum::<f64>() / count as f64)
        .collect();
    let rows: Vec<Vec<f32>> = (0..samples.nrows())
        .into_par_iter()
        .map(|i| {
            let mut place = vec![0.0_f64; dimensions];
            for (l, mean) in mean.iter().enumerate() {
                let off = f64::from(paths[[l, i]]).powi(2) - mean;
                for (k, out) in place.iter_mut().enumerate() {
                    *out -= 0.5 * f64::from(landmark_coordinates[[l, k]]) / eigenvalues[k] * off;
                }
            }
            place.into_iter().map(|v| v as f32).collect()
        })
        .collect();
    let mut coordinates = Array2::zeros((samples.nrows(), dimensions));
    for (i, row) in rows.into_iter().enumerate() {
        coordinates.slice_mut(s![i, ..]).iter_mut().zip(row).for_each(|(out, v)| *out = v);
    }
    Ok(LandmarkIsomap { coordinates, landmarks: chosen, eigenvalues })
}

/// Farthest-point landmarks: the first tenth individually, the rest evenly by rank of distance to those.
fn spread(graph: &Graph, count: usize) -> Vec<usize> {
    let n = graph.nodes();
    let careful = (count / 10).max(8).min(count);
    let mut nearest = vec![f32::INFINITY; n];
    let (mut chosen, mut next) = (Vec::with_capacity(count), 0);
    while chosen.len() < careful {
        chosen.push(next);
        for (near, d) in nearest.iter_mut().zip(dijkstra(graph, next)) {
            *near = near.min(d);
        }
        next = (0..n).max_by(|&a, &b| nearest[a].total_cmp(&nearest[b])).unwrap_or(0);
    }
    let mut rest: Vec<usize> = (0..n).filter(|i| !chosen.contains(i)).collect();
    rest.sort_by(|&a, &b| nearest[a].total_cmp(&nearest[b]).then(a.cmp(&b)));
    let missing = count - chosen.len();
    if missing > 0 {
        chosen.extend((0..missing).map(|i| rest[(2 * i + 1) * rest.len() / (2 * missing)]));
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::super::isomap::isomap;
    use super::*;

    #[test]
    fn landmarks_lay_out_what_all_samples_do() {
        // A bent sheet of 20 x 30 points.
        let sheet = Array2::from_shape_fn((600, 3), |(i, k)| {
            let (a, b) = ((i % 20) as f32 * 0.1, (i / 20) as f32 * 0.1);
            [(1.3 * b).cos(), a, (1.3 * b).sin()][k]
        });
        let whole = isomap(sheet.view(), 8, 2).expect("connected");
        let part = landmark_isomap(sheet.view(), 8, 80, 2).expect("connected");
        for k in 0..2 {
            let (a, b) = (whole.coordinates.column(k), part.coordinates.column(k));
            let (ma, mb) = (a.mean().expect("samples"), b.mean().expect("samples"));
            let (a, b) = (a.mapv(|v| v - ma), b.mapv(|v| v - mb));
            let correlation = a.dot(&b) / (a.dot(&a) * b.dot(&b)).sqrt();
            assert!(correlation.abs() > 0.99, "dimension {k}: {correlation}");
        }
        assert!(landmark_isomap(sheet.view(), 8, 3, 2).is_err());
    }
}
