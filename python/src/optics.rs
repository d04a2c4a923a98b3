//! Optics and operators.

use std::path::PathBuf;

use farnear_depth::{
    operators::{self, Design, Family, Request},
    optics::{FocusSection, LensSection, OpticsFile, SensorSection},
    psf::Psf,
};
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use crate::errors::{FarnearError, wrong};

/// Telecentric thin-lens geometry of a pair.
#[pyclass(frozen, eq, module = "farnear", from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Optics(pub farnear_depth::optics::Optics);

#[pymethods]
impl Optics {
    #[new]
    #[pyo3(signature = (*, focal_length_mm, pixel_um, far_mm, aperture_mm=None, f_number=None, max_blur_px=None, near_mm=None,
                        psf="pillbox", telecentric=None))]
    #[allow(clippy::too_many_arguments)] // keywords in Python
    fn new(
        focal_length_mm: f64,
        pixel_um: f64,
        far_mm: f64,
        aperture_mm: Option<f64>,
        f_number: Option<f64>,
        max_blur_px: Option<f64>,
        near_mm: Option<f64>,
        psf: &str,
        telecentric: Option<bool>,
    ) -> PyResult<Self> {
        let file = OpticsFile {
            lens: LensSection { focal_length_mm, aperture_mm, f_number, telecentric },
            sensor: SensorSection { pixel_um },
            focus: FocusSection { far_mm, max_blur_px, near_mm },
            psf: psf.parse::<Psf>().map_err(wrong)?,
            distortion: None,
        };
        file.check().map(Self).map_err(wrong)
    }

    #[staticmethod]
    fn loads(text: &str) -> PyResult<Self> {
        let file: OpticsFile = toml::from_str(text).map_err(wrong)?;
        file.check().map(Self).map_err(wrong)
    }

    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let text = std::fs::read_to_string(&path)?;
        Self::loads(&text).map_err(|error| FarnearError::new_err(format!("{}: {error}", path.display())))
    }

    /// For pickle.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Self>().getattr("loads")?, (self.dumps()?,)))
    }

    fn dumps(&self) -> PyResult<String> {
        toml::to_string(&self.0).map_err(wrong)
    }

    fn depth_mm(&self, alpha: f64) -> f64 {
        self.0.depth_mm(alpha)
    }

    fn alpha(&self, depth_mm: f64) -> f64 {
        self.0.alpha(depth_mm)
    }

    fn blur_px(&self, alpha: f64) -> (f64, f64) {
        let [far, near] = self.0.blur_px(alpha);
        (far, near)
    }

    #[getter]
    fn focal_length_mm(&self) -> f64 {
        self.0.focal_length_mm()
    }

    #[getter]
    fn f_number(&self) -> f64 {
        self.0.f_number()
    }

    #[getter]
    fn pixel_um(&self) -> f64 {
        self.0.pixel_um()
    }

    #[getter]
    fn max_blur_px(&self) -> f64 {
        self.0.max_blur_px()
    }

    #[getter]
    fn psf(&self) -> String {
        self.0.psf().to_string()
    }

    #[getter]
    fn far_mm(&self) -> f64 {
        self.0.working_range().far_mm
    }

    #[getter]
    fn near_mm(&self) -> f64 {
        self.0.working_range().near_mm
    }

    #[getter]
    fn sensor_far_mm(&self) -> f64 {
        self.0.working_range().sensor_far_mm
    }

    #[getter]
    fn sensor_near_mm(&self) -> f64 {
        self.0.working_range().sensor_near_mm
    }

    fn __repr__(&self) -> String {
        let range = self.0.working_range();
        format!(
            "Optics({:.4} to {:.4} mm, blur up to {:.4} px, {})",
            range.far_mm,
            range.near_mm,
            self.0.max_blur_px(),
            self.0.psf()
        )
    }
}

/// Rational operators.
#[pyclass(frozen, module = "farnear")]
pub struct Operators(pub operators::Operators);

#[pymethods]
impl Operators {
    #[new]
    #[pyo3(signature = (optics, *, family=None, design="linear", kernel_size=7))]
    fn new(
        py: Python<'_>,
        optics: &Optics,
        family: Option<&str>,
        design: &str,
        kernel_size: usize,
    ) -> PyResult<Self> {
        let usual = Request::for_optics(&optics.0);
        let family: Family = family.map_or(Ok(usual.family), str::parse).map_err(wrong)?;
        let design: Design = design.parse().map_err(wrong)?;
        let request = Request { family, design, kernel_size, ..usual };
        py.detach(|| operators::design(&request)).map(Self).map_err(wrong)
    }

    #[staticmethod]
    fn loads(text: &str) -> PyResult<Self> {
        toml::from_str(text).map(Self).map_err(wrong)
    }

    /// For pickle.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Self>().getattr("loads")?, (self.dumps()?,)))
    }

    fn dumps(&self) -> PyResult<String> {
        toml::to_string(&self.0).map_err(wrong)
    }

    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    #[getter]
    fn nir_rms(&self) -> f64 {
        self.0.nir_rms()
    }

    #[getter]
    fn kernel_size(&self) -> usize {
        self.0.kernel_size()
    }

    fn kernel<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let kernel = match name {
            "prefilter" => self.0.prefilter(),
            "gm1" => self.0.gm1(),
            "gp1" => self.0.gp1(),
            "gp2" => self.0.gp2(),
            other => {
                let message = format!("there is no kernel {other:?}; expected prefilter, gm1, gp1 or gp2");
                return Err(FarnearError::new_err(message));
            }
        };
        Ok(kernel.to_array().into_pyarray(py))
    }

    fn __repr__(&self) -> String {
        format!("Operators({})", self.0.name())
    }
}
