//! Corrections of field curvature.

use std::path::PathBuf;

use farnear_depth::corrections::{self, CdcSettings, Method, Pattern};
use farnear_workflows::calibrate::correction::{check_distance, errors, unlike_others};
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use crate::{
    arrays::{Map, named},
    errors::{FarnearError, read_text, wrong},
    work,
};

/// Correction of field curvature, fitted to depth maps of flat targets or loaded; immutable.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
/// >>> targets = []
/// >>> for mm in (932, 921, 910, 899, 888):
/// ...     far, near, _ = farnear.render(optics, f"plane:{mm}", width=160, height=120, elliptical_distortion=True)
/// ...     targets.append((farnear.depth(far, near, optics).depth_mm, mm))
/// >>> farnear.Correction.fit(targets, method="clsf")
/// Correction(clsf, 120x160, 932 to 888 mm)
#[pyclass(frozen, module = "farnear")]
pub struct Correction {
    correction: corrections::Correction,
    findings: Vec<String>,
}

impl From<corrections::Correction> for Correction {
    fn from(correction: corrections::Correction) -> Self {
        Self { correction, findings: Vec::new() }
    }
}

/// The text of a correction, and its findings.
type Parts = (String, Vec<String>);

#[pymethods]
impl Correction {
    /// Fit a correction to flat targets.
    ///
    /// Parameters
    /// ----------
    /// patterns : sequence of (depth_mm, true_mm)
    ///     Depth map (height, width) in mm of a flat target, and the target's true distance in mm; 20 to 30 through the working range
    ///     are good. 24 maps of 640x480 take 0.1 s (clsf) to 1.2 s (cdc).
    /// method : {"clsf", "clsf-blend", "clsf-full", "cdc", "two-step", "spline"}
    ///     Form of the correction.
    #[staticmethod]
    #[pyo3(signature = (patterns, *, method="spline"))]
    fn fit(py: Python<'_>, patterns: Vec<(Bound<'_, PyAny>, f64)>, method: &str) -> PyResult<Self> {
        let method: Method = method.parse().map_err(wrong)?;
        let mut maps = Vec::with_capacity(patterns.len());
        for (index, (map, true_mm)) in patterns.iter().enumerate() {
            let map: Map<'_> = named(&format!("patterns[{index}][0]"), map)?;
            let pattern = Pattern { depth_mm: map.view(), true_mm: *true_mm };
            check_distance(&format!("patterns[{index}]"), &pattern).map_err(wrong)?;
            maps.push((map.view().to_owned(), *true_mm));
        }
        let fit = move || {
            let patterns: Vec<Pattern<'_>> = maps
                .iter()
                .map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm: *true_mm })
                .collect();
            let correction = corrections::fit(method, &patterns, &CdcSettings::default()).map_err(wrong)?;
            let errors = errors(&maps, Some(&correction)).map_err(wrong)?;
            let findings = unlike_others(&errors, |index| format!("patterns[{index}]"));
            Ok::<_, PyErr>(Self { correction, findings })
        };
        work::watched(py, fit)?
    }

    /// Read a correction from the TOML that `farnear calibrate correction --out` writes.
    #[staticmethod]
    fn loads(py: Python<'_>, text: &str) -> PyResult<Self> {
        py.detach(|| toml::from_str::<corrections::Correction>(text)).map(Self::from).map_err(wrong)
    }

    /// Read a file that `farnear calibrate correction --out` wrote.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let text = read_text(&path)?;
        Self::loads(py, &text).map_err(|error| FarnearError::new_err(format!("{}: {error}", path.display())))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let parts = (self.dumps(py)?, self.findings.clone());
        Ok((py.get_type::<Self>().getattr("_assemble")?, parts))
    }

    /// A correction from its parts, for pickle.
    #[staticmethod]
    fn _assemble(py: Python<'_>, text: &str, findings: Vec<String>) -> PyResult<Self> {
        Ok(Self { findings, ..Self::loads(py, text)? })
    }

    /// TOML of the correction, as `farnear correct --correction` reads it.
    fn dumps(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| toml::to_string(&self.correction)).map_err(wrong)
    }

    /// Correct a depth map. `depth_mm` is (height, width) in mm. Returns float32 (height, width) in mm; NaN stays NaN, and depths beyond the fitted range become NaN.
    fn apply<'py>(
        &self,
        py: Python<'py>,
        depth_mm: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let map: Map<'py> = named("depth_mm", depth_mm)?;
        let map = map.view();
        Ok(work::run(py, || self.correction.apply(map))?.map_err(wrong)?.into_pyarray(py))
    }

    /// Method of the correction.
    #[getter]
    fn method(&self) -> String {
        self.correction.method().to_string()
    }

    /// (height, width) of the maps that it corrects.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.correction.dim()
    }

    /// True distances in mm of the farthest and the nearest target.
    #[getter]
    fn range_mm(&self) -> (f64, f64) {
        self.correction.range_mm()
    }

    /// Targets whose error stays unusually large after the correction, for example because of a wrong distance. Empty after `load`.
    #[getter]
    fn findings(&self) -> Vec<String> {
        self.findings.clone()
    }

    fn __repr__(&self) -> String {
        let ((height, width), (far_mm, near_mm)) = (self.correction.dim(), self.correction.range_mm());
        format!("Correction({}, {height}x{width}, {far_mm} to {near_mm} mm)", self.correction.method())
    }
}
