//! Isomap and the map that embeds new samples.

use farnear_recognition::embedding::{EmbeddingError, isomap::isomap as lay_out, rbf};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::{
    arrays::Samples,
    errors::{DisconnectedError, wrong},
    work,
};

/// Coordinates, eigenvalues, geodesic distances.
type Laid<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f32>>);

/// Isomap of float32 samples (n, features). Returns coordinates (n, dimensions), eigenvalues (dimensions) and path lengths (n, n).
#[pyfunction]
#[pyo3(signature = (samples, *, neighbours=5, dimensions=2))]
pub fn isomap<'py>(
    py: Python<'py>,
    samples: Samples<'py>,
    neighbours: usize,
    dimensions: usize,
) -> PyResult<Laid<'py>> {
    let samples = samples.view().to_owned();
    let found = work::watched(py, move || lay_out(samples.view(), neighbours, dimensions))?;
    let found = found.map_err(|error| match &error {
        EmbeddingError::Disconnected { .. } => DisconnectedError::new_err(error.to_string()),
        _ => wrong(error),
    })?;
    Ok((
        found.coordinates.into_pyarray(py),
        found.eigenvalues.into_pyarray(py),
        found.geodesics.into_pyarray(py),
    ))
}

/// Centres, weights, gamma, ridge, condition.
type Parts<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>, f32, f64, f64);

/// Gaussian radial basis functions on all samples (n, features), solved with a ridge for targets (n, d).
#[pyclass(frozen, module = "farnear._farnear")]
pub struct Rbf(rbf::Rbf);

#[pymethods]
impl Rbf {
    #[new]
    #[pyo3(signature = (samples, targets, *, gamma, ridge=1e-3))]
    fn new(
        py: Python<'_>,
        samples: Samples<'_>,
        targets: Samples<'_>,
        gamma: f32,
        ridge: f64,
    ) -> PyResult<Self> {
        let (samples, targets) = (samples.view().to_owned(), targets.view().to_owned());
        work::watched(py, move || rbf::Rbf::train(samples.view(), targets.view(), gamma, ridge))?
            .map(Self)
            .map_err(wrong)
    }

    /// Coordinates, float32 (m, d), of samples, float32 (m, features).
    fn embed<'py>(&self, py: Python<'py>, samples: Samples<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let samples = samples.view();
        Ok(work::run(py, || self.0.embed_all(samples))?.map_err(wrong)?.into_pyarray(py))
    }

    /// A map from what [`Self::__reduce__`] gives.
    #[staticmethod]
    fn assemble(centres: Samples<'_>, weights: Samples<'_>, gamma: f32, ridge: f64, condition: f64) -> Self {
        let (centres, weights) = (centres.view().to_owned(), weights.view().to_owned());
        Self(rbf::Rbf::assemble(centres, weights, gamma, ridge, condition))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let rbf::Rbf { centres, weights, gamma, ridge, condition, .. } = &self.0;
        let arrays = (PyArray2::from_array(py, centres), PyArray2::from_array(py, weights));
        let assemble = py.get_type::<Self>().getattr("assemble")?;
        Ok((assemble, (arrays.0, arrays.1, *gamma, *ridge, *condition)))
    }

    /// Condition number of the system that was solved.
    #[getter]
    fn condition(&self) -> f64 {
        self.0.condition
    }
}
