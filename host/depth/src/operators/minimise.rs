//! Levenberg-Marquardt over the concatenated taps of several kernels.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned, U1, VecStorage};

use super::DesignError;

/// Residuals at given taps, with derivatives.
pub(super) trait Misfit {
    fn residuals(&self, taps: &[f64]) -> DVector<f64>;

    /// A row for each residual, a column for each tap.
    fn jacobian(&self, taps: &[f64]) -> DMatrix<f64>;
}

/// The least-squares taps near `start`. Returns [`DesignError::Minimisation`] without convergence.
pub(super) fn minimise(
    misfit: impl Misfit,
    start: Vec<f64>,
    search: &LevenbergMarquardt<f64>,
) -> Result<Vec<f64>, DesignError> {
    let (problem, report) = search.minimize(Problem { misfit, taps: DVector::from_vec(start) });
    if report.termination.was_usage_issue() || !report.objective_function.is_finite() {
        return Err(DesignError::Minimisation(format!("{:?}", report.termination)));
    }
    Ok(problem.taps.as_slice().to_vec())
}

struct Problem<M> {
    misfit: M,
    taps: DVector<f64>,
}

impl<M: Misfit> LeastSquaresProblem<f64, Dyn, Dyn> for Problem<M> {
    type ResidualStorage = VecStorage<f64, Dyn, U1>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = VecStorage<f64, Dyn, U1>;

    fn set_params(&mut self, taps: &DVector<f64>) {
        self.taps.copy_from(taps);
    }

    fn params(&self) -> DVector<f64> {
        self.taps.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.misfit.residuals(self.taps.as_slice()))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.misfit.jacobian(self.taps.as_slice()))
    }
}
