//! Optics and operators.

use std::path::PathBuf;

use farnear_depth::{
    operators::{self, Design, Family, Request},
    optics::{FocusSection, LensSection, OpticsFile, SensorSection},
    psf::Psf,
};
use farnear_workflows::optics::{OpticsDoubt, doubts};
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use crate::{
    errors::{FarnearError, read_text, wrong},
    work,
};

/// A point spread function as text: `MODEL:NAME=VALUE`, or the TOML of a measured profile.
pub fn psf_text(psf: Psf) -> PyResult<String> {
    match psf {
        Psf::Radial(_) => toml::to_string(&psf).map_err(wrong),
        named => Ok(named.to_string()),
    }
}

fn psf_of(text: &str) -> PyResult<Psf> {
    if text.contains('\n') { toml::from_str(text).map_err(wrong) } else { text.parse().map_err(wrong) }
}

/// Thin-lens geometry of a pair whose sensor moves; immutable.
///
/// The normalised depth `alpha` is -1 at the far focus and +1 at the near focus.
///
/// Parameters
/// ----------
/// focal_length_mm : float
///     Focal length, mm.
/// pixel_um : float
///     Pitch of the pixels, um.
/// far_mm : float
///     Distance from the lens to the far-focused plane, mm.
/// aperture_mm, f_number : float, optional
///     Diameter of the aperture in mm, or the f-number: give one of them.
/// max_blur_px, near_mm : float, optional
///     Blur radius in px of an object at the near focus in the far-focused image, or the distance of the near-focused plane in
///     mm: give one of them.
/// psf : str
///     Point spread function: "pillbox", "gaussian:k=K", "generalised:p=P,k=K", "ring:inner=R", or `PsfFit.psf`.
/// telecentric : bool, optional
///     False if the magnification changes with focus.
///
/// Examples
/// --------
/// >>> farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
/// Optics(933.0000 to 886.8133 mm, blur up to 2.7030 px, pillbox)
#[pyclass(frozen, eq, module = "farnear", from_py_object)]
#[derive(Clone)]
pub struct Optics(
    pub farnear_depth::optics::Optics,
    // False only for a file without `[psf]`.
    bool,
);

impl Optics {
    pub fn doubts(&self) -> Vec<OpticsDoubt> {
        doubts(&self.0, self.1)
    }

    pub fn binned(&self, bin: usize) -> Self {
        Self(self.0.binned(bin), self.1)
    }
}

impl From<farnear_depth::optics::Optics> for Optics {
    fn from(optics: farnear_depth::optics::Optics) -> Self {
        Self(optics, true)
    }
}

impl PartialEq for Optics {
    // A pill-box that is assumed equals one that is named.
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

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
            psf: psf_of(psf)?,
            distortion: None,
            stage: None,
            light: None,
        };
        file.check().map(Self::from).map_err(wrong)
    }

    /// Read optics from the text of an `optics.toml`. Without a `[psf]` a pill-box is assumed, which is a finding of `depth`.
    #[staticmethod]
    fn loads(text: &str) -> PyResult<Self> {
        let file: OpticsFile = toml::from_str(text).map_err(wrong)?;
        let table: toml::Table = text.parse().map_err(wrong)?;
        file.check().map(|optics| Self(optics, table.contains_key("psf"))).map_err(wrong)
    }

    /// Read an `optics.toml` file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let text = read_text(&path)?;
        Self::loads(&text).map_err(|error| FarnearError::new_err(format!("{}: {error}", path.display())))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Self>().getattr("loads")?, (self.dumps()?,)))
    }

    /// Text of an `optics.toml` with these optics, without `[psf]` if their file named none.
    fn dumps(&self) -> PyResult<String> {
        if self.1 {
            return toml::to_string(&self.0).map_err(wrong);
        }
        let mut table = toml::Table::try_from(self.0).map_err(wrong)?;
        table.remove("psf");
        toml::to_string(&table).map_err(wrong)
    }

    /// Object distance in mm of a normalised depth (-1 at the far focus, +1 at the near focus).
    fn depth_mm(&self, alpha: f64) -> f64 {
        self.0.depth_mm(alpha)
    }

    /// Normalised depth of an object distance in mm.
    fn alpha(&self, depth_mm: f64) -> f64 {
        self.0.alpha(depth_mm)
    }

    /// Signed blur radii (far image, near image) in px at a normalised depth.
    fn blur_px(&self, alpha: f64) -> (f64, f64) {
        let [far, near] = self.0.blur_px(alpha);
        (far, near)
    }

    /// Focal length of the lens, mm.
    #[getter]
    fn focal_length_mm(&self) -> f64 {
        self.0.focal_length_mm()
    }

    /// Focal length over the diameter of the aperture.
    #[getter]
    fn f_number(&self) -> f64 {
        self.0.f_number()
    }

    /// Pitch of the pixels, um.
    #[getter]
    fn pixel_um(&self) -> f64 {
        self.0.pixel_um()
    }

    /// Blur radius of an object at one focus in the image focused at the other, px.
    #[getter]
    fn max_blur_px(&self) -> f64 {
        self.0.max_blur_px()
    }

    /// Point spread function, as `Optics(psf=...)` accepts it.
    #[getter]
    fn psf(&self) -> String {
        psf_text(self.0.psf()).unwrap_or_else(|_| self.0.psf().to_string())
    }

    /// Object distance of the far focus, mm.
    #[getter]
    fn far_mm(&self) -> f64 {
        self.0.working_range().far_mm
    }

    /// Object distance of the near focus, mm.
    #[getter]
    fn near_mm(&self) -> f64 {
        self.0.working_range().near_mm
    }

    /// Distance from the lens to the sensor for the far-focused image, mm.
    #[getter]
    fn sensor_far_mm(&self) -> f64 {
        self.0.working_range().sensor_far_mm
    }

    /// Distance from the lens to the sensor for the near-focused image, mm.
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

/// Rational operators designed for some optics; immutable. A design takes some ms, "thesis" up to a second.
///
/// Parameters
/// ----------
/// optics : Optics
///     The optics to design the operators for.
/// family : {"watanabe", "raj", "ro", "gro", "ggro"}, optional
///     Family of operators; by default the one that belongs to the point spread function.
/// design : {"linear", "thesis"}
///     Least squares, or the design of the thesis.
/// kernel_size : int
///     Side of the kernels, px: 5, 7, 9, 11 or 13.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
/// >>> farnear.Operators(optics).kernel("gp1").shape
/// (7, 7)
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
        work::run(py, || operators::design(&request))?.map(Self).map_err(wrong)
    }

    /// Read operators from the TOML that `farnear operators --out` writes.
    #[staticmethod]
    fn loads(text: &str) -> PyResult<Self> {
        toml::from_str(text).map(Self).map_err(wrong)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Self>().getattr("loads")?, (self.dumps()?,)))
    }

    /// TOML of the operators, as `farnear operators --out` writes it.
    fn dumps(&self) -> PyResult<String> {
        toml::to_string(&self.0).map_err(wrong)
    }

    /// Name of family and design.
    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    /// Root mean square error with which the operators fit the normalised image ratio.
    #[getter]
    fn nir_rms(&self) -> f64 {
        self.0.nir_rms()
    }

    /// Side of the kernels, px.
    #[getter]
    fn kernel_size(&self) -> usize {
        self.0.kernel_size()
    }

    /// Kernel "prefilter", "gm1", "gp1" or "gp2": float64, (kernel_size, kernel_size).
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
