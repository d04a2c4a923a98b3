//! Points of a depth map in space.

use numpy::{IntoPyArray, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::optics::Optics;

#[pyfunction]
pub fn points_mm<'py>(
    py: Python<'py>,
    depth_mm: PyReadonlyArray2<'py, f32>,
    optics: &Optics,
) -> Bound<'py, PyArray3<f32>> {
    let depth_mm = depth_mm.as_array();
    py.detach(|| farnear_workflows::measure::points_mm(depth_mm, &optics.0)).into_pyarray(py)
}
