//! Linear least squares of the operator design: at most a few thousand equations in at most 84 unknowns.

use nalgebra::{DMatrix, DVector};

use super::DesignError;

/// Relative singular values that count as zero: undetermined taps get the smallest solution.
const RELATIVE_RANK: f64 = 1e-12;

/// Equations that are reduced together, few enough for a second-level cache.
const TOGETHER: usize = 256;

/// As many equations as unknowns and one more, with the same normal equations: triangular factors of parts of the rows, each
/// with what the parts before left (TSQR; Demmel, Grigori, Hoemmen & Langou 2012).
pub fn reduced(rows: &[(Vec<f64>, f64)]) -> (DMatrix<f64>, DVector<f64>) {
    let columns = rows[0].0.len() + 1;
    let mut left = DMatrix::zeros(0, columns);
    for part in rows.chunks(TOGETHER) {
        let own = left.nrows();
        let value = |i: usize, j: usize| match part.get(i) {
            Some((row, right)) => row.get(j).copied().unwrap_or(*right),
            None => left[(i - part.len(), j)],
        };
        left = DMatrix::from_fn(own + part.len(), columns, value).qr().unpack_r();
    }
    let right = left.column(columns - 1).into_owned();
    (left.remove_column(columns - 1), right)
}

/// Equations of one frequency in factors of several kernels, as equations in their taps, of these `responses`. As all
/// equations have the same responses, as many as factors remain (a triangular factor's Kronecker product with them).
pub fn in_taps(equations: &[(Vec<f64>, f64)], responses: &[f64]) -> Vec<(Vec<f64>, f64)> {
    let (matrix, right) = reduced(equations);
    let row = |i: usize| {
        let factors = matrix.row(i);
        (factors.iter().flat_map(|factor| responses.iter().map(move |r| factor * r)).collect(), right[i])
    };
    (0..matrix.nrows().min(matrix.ncols())).map(row).collect()
}

/// Minimises `|matrix x - rhs|^2` by QR and SVD. Returns [`DesignError::Singular`] without a finite solution.
pub fn solve(matrix: DMatrix<f64>, rhs: DVector<f64>) -> Result<DVector<f64>, DesignError> {
    let unknowns = matrix.ncols();
    let qr = matrix.qr();
    let mut projected = rhs;
    qr.q_tr_mul(&mut projected);
    let svd =
        qr.unpack_r().try_svd(true, true, f64::EPSILON, 10_000).ok_or(DesignError::Singular { unknowns })?;
    let largest = svd.singular_values.max();
    let solution = svd
        .solve(&projected.rows(0, unknowns).into_owned(), RELATIVE_RANK * largest)
        .map_err(|_| DesignError::Singular { unknowns })?;
    if solution.iter().all(|x| x.is_finite()) {
        Ok(solution)
    } else {
        Err(DesignError::Singular { unknowns })
    }
}
