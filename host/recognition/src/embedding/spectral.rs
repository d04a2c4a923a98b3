//! Leading eigenpairs of a symmetric matrix by block Krylov subspaces and Rayleigh-Ritz. A block is
//! repeatedly multiplied by the matrix and orthogonalised twice against all previous ones; the projected
//! matrix gives the pairs (Golub and Van Loan, Matrix Computations, section 10.3.6). A block costs one pass
//! over the matrix; about eight suffice for a gallery of 1500. Falls back to the dense solver.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, Side};

/// Smaller matrices are decomposed completely.
const WHOLE: usize = 128;
/// Additional vectors that separate pairs of nearly equal value.
const SPARE: usize = 5;
/// Limit of blocks before the dense solver.
const MOST_BLOCKS: usize = 24;

pub(crate) type Pairs = (Vec<f64>, Vec<Vec<f64>>);

/// The `wanted` largest positive eigenpairs of a symmetric row-major n x n matrix, descending, or fewer. Unit
/// eigenvectors as rows, largest entry positive for repeatability.
pub(crate) fn leading(matrix: &[f64], n: usize, wanted: usize) -> Pairs {
    let view = MatRef::from_row_major_slice(matrix, n, n);
    let apply = |block: &Mat<f64>| product_of(view, block.as_ref());
    leading_of(n, wanted, 1e-8, apply).unwrap_or_else(|| positive(whole(view), wanted))
}

/// [`leading`] for an operator, to `tolerance` times the largest eigenvalue; `None` if it does not converge.
pub(super) fn leading_of(
    n: usize,
    wanted: usize,
    tolerance: f64,
    apply: impl Fn(&Mat<f64>) -> Mat<f64>,
) -> Option<Pairs> {
    let width = wanted + SPARE;
    if n <= WHOLE || 4 * width > n {
        return None;
    }
    // A repeatable start block with all directions.
    let start = Mat::<f64>::from_fn(n, width, |i, k| {
        0.5 - ((i as f64 + 1.0) * (0.754_877_666_2 + 0.569_840_290_998 * k as f64)).fract()
    });
    let mut basis = Mat::<f64>::zeros(n, 0);
    let mut images = Mat::<f64>::zeros(n, 0);
    let mut block = start;
    for round in 1..=MOST_BLOCKS {
        let fresh = orthonormal(&basis, block);
        if fresh.ncols() == 0 {
            return None;
        }
        let image = apply(&fresh);
        basis = joined(&basis, &fresh);
        images = joined(&images, &image);
        block = image;
        // No convergence is possible earlier.
        if round >= 4 {
            let seen = product_of(basis.transpose(), images.as_ref());
            let symmetric =
                Mat::<f64>::from_fn(seen.nrows(), seen.ncols(), |i, j| 0.5 * (seen[(i, j)] + seen[(j, i)]));
            let ritz = whole(symmetric.as_ref());
            let largest = ritz.iter().fold(0.0_f64, |m, pair| m.max(pair.0.abs()));
            let (values, rows) = positive(ritz, wanted);
            let turn = Mat::<f64>::from_fn(seen.nrows(), rows.len(), |i, k| rows[k][i]);
            let vectors = product_of(basis.as_ref(), turn.as_ref());
            let turned = product_of(images.as_ref(), turn.as_ref());
            let settled = (0..rows.len()).all(|k| {
                let off: f64 = (0..n).map(|i| (turned[(i, k)] - values[k] * vectors[(i, k)]).powi(2)).sum();
                off.sqrt() <= tolerance * largest
            });
            if settled && rows.len() == wanted {
                let vectors = (0..wanted).map(|k| signed(vectors.col(k).iter().copied().collect())).collect();
                return Some((values, vectors));
            }
        }
    }
    None
}

/// Orthonormal part of the block, orthogonal to a basis; directions within rounding of the basis are dropped.
fn orthonormal(basis: &Mat<f64>, mut block: Mat<f64>) -> Mat<f64> {
    let lengths: Vec<f64> = (0..block.ncols()).map(|k| block.col(k).norm_l2()).collect();
    for _ in 0..2 {
        if basis.ncols() > 0 {
            let along = product_of(basis.transpose(), block.as_ref());
            matmul(block.as_mut(), Accum::Add, basis, &along, -1.0, Par::rayon(0));
        }
    }
    // Gram-Schmidt inside the block, also twice.
    let n = block.nrows();
    let mut kept: Vec<Vec<f64>> = Vec::new();
    for (k, length) in lengths.into_iter().enumerate() {
        let mut column: Vec<f64> = block.col(k).iter().copied().collect();
        for _ in 0..2 {
            for other in &kept {
                let along: f64 = other.iter().zip(&column).map(|(a, b)| a * b).sum();
                column.iter_mut().zip(other).for_each(|(c, o)| *c -= along * o);
            }
        }
        let norm = column.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm > 1e-9 * length {
            column.iter_mut().for_each(|v| *v /= norm);
            kept.push(column);
        }
    }
    Mat::from_fn(n, kept.len(), |i, k| kept[k][i])
}

fn product_of(a: MatRef<f64>, b: MatRef<f64>) -> Mat<f64> {
    let mut product = Mat::<f64>::zeros(a.nrows(), b.ncols());
    matmul(product.as_mut(), Accum::Replace, a, b, 1.0, Par::rayon(0));
    product
}

fn joined(a: &Mat<f64>, b: &Mat<f64>) -> Mat<f64> {
    let mut both = Mat::<f64>::zeros(b.nrows(), a.ncols() + b.ncols());
    both.as_mut().subcols_mut(0, a.ncols()).copy_from(a);
    both.as_mut().subcols_mut(a.ncols(), b.ncols()).copy_from(b);
    both
}

pub(super) fn positive(mut pairs: Vec<(f64, Vec<f64>)>, wanted: usize) -> Pairs {
    let largest = pairs.iter().fold(0.0_f64, |m, pair| m.max(pair.0.abs()));
    pairs.retain(|pair| pair.0 > 1e-10 * largest);
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    pairs.truncate(wanted);
    pairs.into_iter().map(|(value, vector)| (value, signed(vector))).unzip()
}

fn signed(mut vector: Vec<f64>) -> Vec<f64> {
    let peak = vector.iter().fold(0.0_f64, |peak, v| if v.abs() > peak.abs() + 1e-12 { *v } else { peak });
    if peak < 0.0 {
        vector.iter_mut().for_each(|v| *v = -*v);
    }
    vector
}

pub(super) fn whole(view: MatRef<f64>) -> Vec<(f64, Vec<f64>)> {
    let Ok(eigen) = view.self_adjoint_eigen(Side::Lower) else { return Vec::new() };
    let values = eigen.S().column_vector();
    (0..view.nrows()).map(|k| (values[k], eigen.U().col(k).iter().copied().collect())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partial_and_whole_solver_agree_and_negative_pairs_are_dropped() {
        // Known spectrum: Householder-reflected diagonal with one large negative entry.
        let n = 200;
        let diagonal = |i: usize| match i {
            0 => 50.0,
            1 => -80.0,
            2 => 30.0,
            3 => 20.0,
            _ => 1.0 / (i as f64),
        };
        let v: Vec<f64> = (0..n).map(|i| (1.0 + i as f64).sqrt()).collect();
        let norm: f64 = v.iter().map(|x| x * x).sum();
        let h = |i: usize, j: usize| f64::from(u8::from(i == j)) - 2.0 * v[i] * v[j] / norm;
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                matrix[i * n + j] = (0..n).map(|k| h(i, k) * diagonal(k) * h(k, j)).sum();
            }
        }
        let (values, vectors) = leading(&matrix, n, 3);
        assert_eq!(vectors.len(), 3);
        for (found, expected) in values.iter().zip([50.0, 30.0, 20.0]) {
            assert!((found - expected).abs() < 1e-6, "{values:?}");
        }
    }
}
