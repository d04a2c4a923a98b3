//! Isomap (Tenenbaum, de Silva, Langford, Science 290, 2000): classical scaling of geodesic distances. Coordinates are
//! the leading eigenvectors of `B = -1/2 J D^2 J` times the square roots of their eigenvalues. K = N - 1 (the thesis'
//! choice) is exactly PCA. O(N^2 (d + K)) time, 8 N^2 bytes.

use super::geodesic::all_pairs;
use super::neighbours::Graph;
use super::{EmbeddingError, check, spectral};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

/// Layout of a gallery in few dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Isomap {
    /// One row per sample, one column per dimension.
    pub coordinates: Array2<f32>,
    /// Descending eigenvalues.
    pub eigenvalues: Vec<f64>,
    /// Path lengths between all samples.
    pub geodesics: Array2<f32>,
}

/// Lays out `samples` (N x d) in `dimensions` dimensions. Fails for too few or non-finite samples, a
/// disconnected graph, or fewer positive eigenvalues than dimensions.
pub fn isomap(
    samples: ArrayView2<f32>,
    neighbours: usize,
    dimensions: usize,
) -> Result<Isomap, EmbeddingError> {
    check(samples, dimensions + 2)?;
    let graph = Graph::new(samples, neighbours)?;
    graph.connected(neighbours)?;
    let geodesics = all_pairs(&graph);
    let (coordinates, eigenvalues) = classical_scaling(&geodesics, dimensions)?;
    Ok(Isomap { coordinates, eigenvalues, geodesics })
}

/// Residual over the largest eigenvalue: single precision, far below the graph's accuracy.
const TOLERANCE: f64 = 1e-5;

pub(super) fn classical_scaling(
    distances: &Array2<f32>,
    dimensions: usize,
) -> Result<(Array2<f32>, Vec<f64>), EmbeddingError> {
    let n = distances.nrows();
    let (values, vectors) = leading(distances, dimensions).unwrap_or_else(|| {
        let centred = double_centred(distances);
        spectral::positive(spectral::whole(MatRef::from_row_major_slice(&centred, n, n)), dimensions)
    });
    if values.len() < dimensions {
        return Err(EmbeddingError::TooFewDimensions { found: values.len(), asked: dimensions });
    }
    let coordinates =
        Array2::from_shape_fn((n, dimensions), |(i, k)| (vectors[k][i] * values[k].sqrt()) as f32);
    Ok((coordinates, values))
}

/// Leading pairs of `-1/2 J D^2 J` without forming it, in single precision for less memory traffic.
fn leading(distances: &Array2<f32>, dimensions: usize) -> Option<spectral::Pairs> {
    let n = distances.nrows();
    let mut squared = vec![0.0_f32; n * n];
    squared.par_chunks_mut(n.max(1)).zip(distances.outer_iter().into_par_iter()).for_each(|(out, row)| {
        out.iter_mut().zip(row).for_each(|(out, d)| *out = d * d);
    });
    let squared = MatRef::from_row_major_slice(&squared, n, n);
    let without_mean = |block: &mut Mat<f64>| {
        for k in 0..block.ncols() {
            let mean = block.col(k).iter().sum::<f64>() / n as f64;
            block.col_mut(k).iter_mut().for_each(|v| *v -= mean);
        }
    };
    spectral::leading_of(n, dimensions, TOLERANCE, |block| {
        let mut centred = block.clone();
        without_mean(&mut centred);
        let single = Mat::<f32>::from_fn(n, centred.ncols(), |i, k| centred[(i, k)] as f32);
        let mut product = Mat::<f32>::zeros(n, centred.ncols());
        matmul(product.as_mut(), Accum::Replace, squared, &single, -0.5, Par::rayon(0));
        let mut product = Mat::<f64>::from_fn(n, centred.ncols(), |i, k| f64::from(product[(i, k)]));
        without_mean(&mut product);
        product
    })
}

fn double_centred(distances: &Array2<f32>) -> Vec<f64> {
    let n = distances.nrows();
    let mut centred: Vec<f64> = distances.iter().map(|&d| f64::from(d).powi(2)).collect();
    let means: Vec<f64> = centred.chunks(n.max(1)).map(|row| row.iter().sum::<f64>() / n as f64).collect();
    let mean = means.iter().sum::<f64>() / n as f64;
    centred.par_chunks_mut(n.max(1)).zip(&means).for_each(|(row, row_mean)| {
        for (value, column_mean) in row.iter_mut().zip(&means) {
            *value = -0.5 * (*value - row_mean - column_mean + mean);
        }
    });
    centred
}

#[cfg(test)]
mod tests {
    use super::super::pca::Pca;
    use super::*;
    use rand::{Rng, SeedableRng};

    fn swiss_roll(n: usize) -> (Array2<f32>, Vec<[f64; 2]>) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let flat: Vec<[f64; 2]> =
            (0..n).map(|_| [rng.random_range(4.0..14.0), rng.random_range(0.0..20.0)]).collect();
        let rolled = Array2::from_shape_fn((n, 3), |(i, k)| {
            let [t, height] = flat[i];
            [t * t.cos(), height, t * t.sin()][k] as f32
        });
        // Arc length of the spiral r = t.
        let arc = |t: f64| 0.5 * (t * (1.0 + t * t).sqrt() + t.asinh());
        (rolled, flat.into_iter().map(|[t, height]| [arc(t), height]).collect())
    }

    fn squared_correlation(squared: &Array2<f32>, distances: &Array2<f32>) -> f64 {
        let (mut n, mut sx, mut sy, mut sxx, mut syy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (&square, &distance) in squared.iter().zip(distances) {
            let (x, y) = (f64::from(square).sqrt(), f64::from(distance));
            n += 1.0;
            sx += x;
            sy += y;
            sxx += x * x;
            syy += y * y;
            sxy += x * y;
        }
        let covariance = sxy - sx * sy / n;
        let variances = (sxx - sx * sx / n) * (syy - sy * sy / n);
        if variances > 0.0 { covariance * covariance / variances } else { 0.0 }
    }

    #[test]
    fn a_swiss_roll_is_unrolled() {
        let (rolled, flat) = swiss_roll(700);
        let found = isomap(rolled.view(), 9, 2).expect("connected");
        // Distances of the layout follow the unrolled sheet.
        let (mut a, mut b) = (Array2::<f32>::zeros((700, 700)), Array2::<f32>::zeros((700, 700)));
        for i in 0..700 {
            for j in 0..700 {
                let d = &found.coordinates.row(i) - &found.coordinates.row(j);
                a[[i, j]] = d.dot(&d);
                b[[i, j]] = (flat[i][0] - flat[j][0]).hypot(flat[i][1] - flat[j][1]) as f32;
            }
        }
        assert!(squared_correlation(&a, &b) > 0.99);
        // Residual of the path lengths: small in two dimensions, larger in one.
        let one = Array2::from_shape_fn((700, 700), |(i, j)| {
            (found.coordinates[[i, 0]] - found.coordinates[[j, 0]]).powi(2)
        });
        let [left_by_one, left_by_two] =
            [&one, &a].map(|squared| 1.0 - squared_correlation(squared, &found.geodesics));
        assert!(left_by_two < 0.02 && left_by_one > left_by_two, "{left_by_one} {left_by_two}");
        let pca =
            Pca::fit(rolled.view(), 2).expect("enough samples").transform(rolled.view()).expect("same width");
        let spread = |c: &Array2<f32>| c.column(0).iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        assert!(spread(&found.coordinates) > 2.0 * spread(&pca), "PCA cannot unroll it");
    }

    #[test]
    fn all_neighbours_make_it_pca() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let samples =
            Array2::from_shape_fn((60, 5), |(_, k)| rng.random_range(0.0..1.0_f32) * (5 - k) as f32);
        let all = isomap(samples.view(), 59, 3).expect("connected");
        let pca = Pca::fit(samples.view(), 3)
            .expect("enough samples")
            .transform(samples.view())
            .expect("same width");
        for k in 0..3 {
            let sign = (all.coordinates.column(k).dot(&pca.column(k))).signum();
            for (a, b) in all.coordinates.column(k).iter().zip(pca.column(k)) {
                assert!((a - sign * b).abs() < 2e-3, "{a} {b}");
            }
        }
    }

    #[test]
    fn bad_input_is_named() {
        let mut samples = Array2::<f32>::zeros((10, 2));
        assert!(matches!(isomap(samples.view(), 3, 20), Err(EmbeddingError::TooFewSamples { .. })));
        // Ten equal points have no dimensions.
        let error = isomap(samples.view(), 9, 2).expect_err("no extent");
        assert_eq!(error, EmbeddingError::TooFewDimensions { found: 0, asked: 2 });
        samples[[4, 1]] = f32::NAN;
        assert_eq!(isomap(samples.view(), 3, 2).expect_err("NaN"), EmbeddingError::NotFinite { row: 4 });
    }
}
