//! The point spread function of a lens, from pairs of flat targets.

use farnear_depth::calibrate::{CapturedPair, Model, fit_psf};
use pyo3::{prelude::*, types::PyDict};

use crate::{arrays::Image, errors::wrong, optics::Optics};

#[pyfunction]
#[pyo3(signature = (pairs, optics, *, model="gaussian"))]
pub fn calibrate_psf<'py>(
    py: Python<'py>,
    pairs: Vec<(Image<'py>, Image<'py>, Option<f64>)>,
    optics: &Optics,
    model: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let model: Model = model.parse().map_err(wrong)?;
    let captured: Vec<CapturedPair<'_>> = pairs
        .iter()
        .map(|(far, near, true_mm)| CapturedPair {
            far: far.view(),
            near: near.view(),
            alpha: true_mm.map(|mm| optics.0.alpha(mm)),
        })
        .collect();
    let fit = py.detach(|| fit_psf(&captured, &optics.0, model)).map_err(wrong)?;
    let said = PyDict::new(py);
    said.set_item("psf", fit.psf.to_string())?;
    said.set_item("residual", fit.residual)?;
    said.set_item("alphas", fit.alphas)?;
    Ok(said)
}
