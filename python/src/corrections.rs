//! Corrections of field curvature.

use std::path::PathBuf;

use farnear_depth::corrections::{self, CdcSettings, Method, Pattern};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::{FarnearError, wrong};

/// A correction, learned or loaded.
#[pyclass(frozen, module = "farnear")]
pub struct Correction(corrections::Correction);

#[pymethods]
impl Correction {
    #[staticmethod]
    #[pyo3(signature = (patterns, *, method="spline"))]
    fn fit(py: Python<'_>, patterns: Vec<(PyReadonlyArray2<'_, f32>, f64)>, method: &str) -> PyResult<Self> {
        let method: Method = method.parse().map_err(wrong)?;
        let patterns: Vec<Pattern<'_>> = patterns
            .iter()
            .map(|(map, true_mm)| Pattern { depth_mm: map.as_array(), true_mm: *true_mm })
            .collect();
        py.detach(|| corrections::fit(method, &patterns, &CdcSettings::default())).map(Self).map_err(wrong)
    }

    #[staticmethod]
    fn loads(py: Python<'_>, text: &str) -> PyResult<Self> {
        py.detach(|| toml::from_str(text)).map(Self).map_err(wrong)
    }

    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text = std::fs::read_to_string(&path)?;
        Self::loads(py, &text).map_err(|error| FarnearError::new_err(format!("{}: {error}", path.display())))
    }

    /// For pickle.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Self>().getattr("loads")?, (self.dumps(py)?,)))
    }

    fn dumps(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| toml::to_string(&self.0)).map_err(wrong)
    }

    fn apply<'py>(
        &self,
        py: Python<'py>,
        depth_mm: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let map = depth_mm.as_array();
        Ok(py.detach(|| self.0.apply(map)).map_err(wrong)?.into_pyarray(py))
    }

    #[getter]
    fn method(&self) -> String {
        self.0.method().to_string()
    }

    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.0.dim()
    }

    #[getter]
    fn range_mm(&self) -> (f64, f64) {
        self.0.range_mm()
    }

    fn __repr__(&self) -> String {
        let ((height, width), (far_mm, near_mm)) = (self.0.dim(), self.0.range_mm());
        format!("Correction({}, {height}x{width}, {far_mm} to {near_mm} mm)", self.0.method())
    }
}
