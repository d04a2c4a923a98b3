//! Linear least squares of the operator design: at most a few thousand equations in at most 84 unknowns.

use nalgebra::{DMatrix, DVector};

use super::DesignError;

/// Relative singular values that count as zero: undetermined taps get the smallest solution.
const RELATIVE_RANK: f64 = 1e-12;

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
