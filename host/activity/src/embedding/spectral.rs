//! The leading eigenpairs of a symmetric matrix.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::matrix_free::eigen::{
    PartialEigenParams, partial_self_adjoint_eigen, partial_self_adjoint_eigen_scratch,
};
use faer::{Col, Mat, MatRef, Par};

/// Below this size the whole decomposition is as fast as a part of it.
const WHOLE: usize = 128;

/// The `wanted` algebraically largest POSITIVE eigenpairs of a symmetric row-major n x n matrix, falling; fewer if fewer are
/// positive. Eigenvectors are rows, of unit length, with their largest entry positive so that results repeat.
pub(super) fn leading(matrix: &[f64], n: usize, wanted: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
    let view = MatRef::from_row_major_slice(matrix, n, n);
    let mut pairs: Vec<(f64, Vec<f64>)> = Vec::new();
    // The partial solver ranks by magnitude, so large negative eigenvalues take places: ask for more and drop them.
    let asked = wanted + 6;
    if n > WHOLE && 4 * asked < n {
        let par = Par::rayon(0);
        let mut vectors = Mat::<f64>::zeros(n, asked);
        let mut values = vec![0.0_f64; asked];
        // A start vector with every direction in it, the same in every run.
        let start = Col::<f64>::from_fn(n, |i| 1.0 + 0.5 * ((i as f64) * 0.7548776662).fract());
        let start = &start * (1.0 / start.norm_l2());
        // Past these restarts the spectrum is too crowded for it and the whole decomposition takes over.
        let params = PartialEigenParams { max_restarts: 40, ..PartialEigenParams::default() };
        let mut memory = MemBuffer::new(partial_self_adjoint_eigen_scratch(&view, asked, par, params));
        let info = partial_self_adjoint_eigen(
            vectors.as_mut(),
            &mut values,
            &view,
            start.as_ref(),
            1e-7,
            par,
            MemStack::new(&mut memory),
            params,
        );
        for (k, value) in values.into_iter().enumerate().take(info.n_converged_eigen) {
            pairs.push((value, vectors.col(k).iter().copied().collect()));
        }
    }
    if pairs.iter().filter(|pair| pair.0 > 0.0).count() < wanted.min(n) {
        pairs = whole(view);
    }
    let largest = pairs.iter().fold(0.0_f64, |m, pair| m.max(pair.0.abs()));
    pairs.retain(|pair| pair.0 > 1e-10 * largest);
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    pairs.truncate(wanted);
    for (_, vector) in &mut pairs {
        let peak =
            vector.iter().fold(0.0_f64, |peak, v| if v.abs() > peak.abs() + 1e-12 { *v } else { peak });
        if peak < 0.0 {
            vector.iter_mut().for_each(|v| *v = -*v);
        }
    }
    pairs.into_iter().unzip()
}

/// All eigenpairs by the dense solver; empty where it does not converge.
fn whole(view: MatRef<f64>) -> Vec<(f64, Vec<f64>)> {
    let Ok(eigen) = view.self_adjoint_eigen(faer::Side::Lower) else { return Vec::new() };
    let values = eigen.S().column_vector();
    (0..view.nrows()).map(|k| (values[k], eigen.U().col(k).iter().copied().collect())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partial_and_whole_solver_agree_and_negative_pairs_are_dropped() {
        // A matrix with known spectrum: Householder-reflected diagonal with one large negative entry.
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
