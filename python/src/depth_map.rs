//! Depth maps as Python objects: pickled, saved, loaded, shown.

use std::{collections::BTreeMap, path::PathBuf};

use farnear_depth::{measure::Measurement, reason::Reason};
use farnear_files::{image_file, map, mesh::Lateral, npy, view::view_png};
use farnear_workflows::{
    MADE_BY,
    depth::part::Part,
    figures::rounded_for,
    measure::{self, Rectangle},
    result_folder,
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::{
    prelude::*,
    types::{PyBytes, PyTuple},
};
use serde::{Deserialize, Serialize};

use crate::{
    errors::{FarnearError, read_text, wrong},
    optics::Optics,
    work,
};

/// Place of a map in its images: four numbers in Python, five where pixels were averaged.
#[derive(Clone, Copy)]
pub struct Place(pub Part);

impl<'py> FromPyObject<'_, 'py> for Place {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (x, y, image_width, image_height, bin) = if object.len()? == 5 {
            object.extract::<(usize, usize, usize, usize, usize)>()?
        } else {
            let (x, y, width, height) = object.extract::<(usize, usize, usize, usize)>()?;
            (x, y, width, height, 1)
        };
        if bin == 0 {
            let message = format!("part is {}; expected a fifth number of at least 1", object.repr()?);
            return Err(FarnearError::new_err(message));
        }
        Ok(Self(Part { x, y, image_width, image_height, bin }))
    }
}

impl<'py> IntoPyObject<'py> for Place {
    type Target = PyTuple;
    type Output = Bound<'py, PyTuple>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let Part { x, y, image_width, image_height, bin } = self.0;
        match bin {
            1 => (x, y, image_width, image_height).into_pyobject(py),
            _ => (x, y, image_width, image_height, bin).into_pyobject(py),
        }
    }
}

/// Used contents of `depth.toml`; the command line writes more.
#[derive(Serialize, Deserialize)]
struct Record {
    #[serde(default)]
    made_by: String,
    #[serde(default)]
    units: String,
    #[serde(default)]
    warnings: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    part: Option<Part>,
    optics: farnear_depth::optics::Optics,
}

/// Depth map of a pair; arrays are (height, width). Can be pickled and copied.
///
/// Attributes
/// ----------
/// depth_mm : array float32
///     Object distance, mm; NaN where there is none.
/// confidence : array float32
///     Probability that the error is below three standard deviations, 0 to 1; 0 where there is no depth.
/// deviation_mm : array float32
///     Standard deviation of depth for the noise in the pair, mm; NaN where there is none.
/// reasons : array uint8
///     Why a pixel has no depth, see `reason_words`; 0 where it has one.
/// findings : list of str
///     What to know before trusting the map.
/// valid_fraction : float
///     Part of the pixels with a depth, 0 to 1.
/// optics : Optics
///     The optics of the map.
/// part : (int, int, int, int), (int, int, int, int, int) or None
///     Column and row of the map in its images, width and height of these, px, and the pixels per side that were averaged, if more
///     than one; None if the map shows whole images.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
/// >>> found = farnear.depth(*farnear.render(optics, "slant", width=160, height=120)[:2], optics)
/// >>> found.depth_mm.shape, found.depth_mm.dtype.name
/// ((120, 160), 'float32')
#[pyclass(frozen, get_all, module = "farnear")]
pub struct DepthMap {
    /// Object distance, mm, float32 (height, width); NaN where there is none.
    depth_mm: Py<PyArray2<f32>>,
    /// Probability that the error is below three standard deviations, 0 to 1, float32 (height, width).
    confidence: Py<PyArray2<f32>>,
    /// Standard deviation of depth for the noise in the pair, mm, float32 (height, width); NaN where there is none.
    deviation_mm: Py<PyArray2<f32>>,
    /// Why a pixel has no depth, uint8 (height, width), see `reason_words`; 0 where it has one.
    reasons: Py<PyArray2<u8>>,
    /// What to know before trusting the map.
    findings: Vec<String>,
    /// Part of the pixels with a depth, 0 to 1.
    valid_fraction: f64,
    /// The optics of the map.
    optics: Optics,
    /// Place of the map in its images, as `points_mm` takes it; None if the map shows whole images.
    part: Option<Place>,
}

/// Arguments of `DepthMap._assemble`.
type Parts<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<u8>>,
    Vec<String>,
    f64,
    Optics,
    Option<Place>,
);

impl DepthMap {
    pub fn of(py: Python<'_>, found: Measurement, optics: &Optics, part: Option<Part>) -> Self {
        let validity = found.validity;
        Self {
            depth_mm: found.map.depth_mm.into_pyarray(py).unbind(),
            confidence: found.map.confidence.into_pyarray(py).unbind(),
            deviation_mm: validity.deviation_mm.into_pyarray(py).unbind(),
            reasons: validity.reasons.into_pyarray(py).unbind(),
            findings: found.findings.iter().map(ToString::to_string).collect(),
            valid_fraction: validity.valid_fraction,
            optics: optics.clone(),
            part: part.map(Place),
        }
    }

    fn view_png(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        let (depth, confidence) = (self.depth_mm.bind(py).readonly(), self.confidence.bind(py).readonly());
        let (depth, confidence) = (depth.as_array(), confidence.as_array());
        work::run(py, move || view_png(depth, confidence))?.map_err(wrong)
    }
}

#[pymethods]
impl DepthMap {
    /// Why pixels have no depth: the numbers in `reasons`, in words.
    #[classattr]
    fn reason_words() -> BTreeMap<u8, &'static str> {
        Reason::ALL.into_iter().map(|reason| (reason.code(), reason.words())).collect()
    }

    /// Read a folder that `farnear depth` or `DepthMap.save` wrote, with `depth.npy` or `depth.tiff` and `depth.toml`.
    ///
    /// Returns
    /// -------
    /// DepthMap
    ///     `deviation_mm` is NaN where the folder has no `uncertainty.npy`.
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let path = folder.join("depth.toml");
        let text = read_text(&path)?;
        let record: Record = toml::from_str(&text).map_err(|error| {
            FarnearError::new_err(format!("{} is not the record of a depth map: {error}", path.display()))
        })?;
        let file =
            ["depth.npy", "depth.tiff"].map(|name| folder.join(name)).into_iter().find(|file| file.is_file());
        let file = file.ok_or_else(|| {
            FarnearError::new_err(format!(
                "{} has neither depth.npy nor depth.tiff; run farnear depth with --write npy",
                folder.display()
            ))
        })?;
        let depth = map::read(&file).map_err(wrong)?;
        let dim = depth.dim();
        let fitting = |name: &str, array: Array2<f32>| {
            if array.dim() == dim {
                return Ok(array);
            }
            let message = format!(
                "{}: {:?} rows and columns, the depth map has {dim:?}",
                folder.join(name).display(),
                array.dim()
            );
            Err(FarnearError::new_err(message))
        };
        let optional = |name: &str| -> PyResult<Option<Array2<f32>>> {
            let file = folder.join(name);
            if !file.is_file() {
                return Ok(None);
            }
            fitting(name, map::read(&file).map_err(wrong)?).map(Some)
        };
        let confidence = optional("confidence.npy")?
            .unwrap_or_else(|| depth.mapv(|depth| if depth.is_finite() { 1.0 } else { 0.0 }));
        let deviation = optional("uncertainty.npy")?.unwrap_or_else(|| Array2::from_elem(dim, f32::NAN));
        let reasons = if folder.join("reason.png").is_file() {
            let codes = image_file::read_grey(&folder.join("reason.png")).map_err(wrong)?.pixels;
            fitting("reason.png", codes)?.mapv(|code| (code * 255.0).round() as u8)
        } else {
            Array2::zeros(dim)
        };
        if record.part.is_some_and(|part| part.bin == 0 || !part.fits(dim)) {
            let (rows, columns) = dim;
            return Err(FarnearError::new_err(format!(
                "{}: its [part] does not fit the map of {columns}x{rows} px",
                folder.join("depth.toml").display()
            )));
        }
        let valid = depth.iter().filter(|depth| depth.is_finite()).count();
        Ok(Self {
            valid_fraction: valid as f64 / depth.len().max(1) as f64,
            depth_mm: depth.into_pyarray(py).unbind(),
            confidence: confidence.into_pyarray(py).unbind(),
            deviation_mm: deviation.into_pyarray(py).unbind(),
            reasons: reasons.into_pyarray(py).unbind(),
            findings: record.warnings,
            optics: record.optics.into(),
            part: record.part.map(Place),
        })
    }

    /// Write a folder as `DepthMap.load` and `farnear measure` read it: `depth.npy`, `confidence.npy`, `uncertainty.npy`,
    /// `reason.png`, `view.png` and `depth.toml`. The folder is complete or absent.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        let staged = result_folder::depth(&folder).map_err(wrong)?;
        let write = |name: &str, bytes: &[u8]| staged.write(name, bytes).map_err(wrong);
        for (name, array) in [
            ("depth.npy", &self.depth_mm),
            ("confidence.npy", &self.confidence),
            ("uncertainty.npy", &self.deviation_mm),
        ] {
            write(name, &npy::write(array.bind(py).readonly().as_array()))?;
        }
        let reasons = self.reasons.bind(py).readonly();
        write(
            "reason.png",
            &image_file::encode_png(reasons.as_array().mapv(u16::from).view(), 8).map_err(wrong)?,
        )?;
        write("view.png", &self.view_png(py)?)?;
        let record = Record {
            made_by: MADE_BY.into(),
            units: "mm".into(),
            warnings: self.findings.clone(),
            part: self.part.map(|place| place.0),
            optics: self.optics.0,
        };
        write("depth.toml", toml::to_string(&record).map_err(wrong)?.as_bytes())?;
        staged.finish().map_err(wrong)
    }

    /// Fit a plane to the map by least squares along the optical axis.
    ///
    /// Parameters
    /// ----------
    /// region : (int, int, int, int), optional
    ///     Column, row, width and height in px; by default the whole map.
    ///
    /// Returns
    /// -------
    /// Plane
    ///     Distance, slopes, tilt, and what is left.
    #[pyo3(signature = (region=None))]
    fn plane(&self, py: Python<'_>, region: Option<(usize, usize, usize, usize)>) -> PyResult<Plane> {
        let depth = self.depth_mm.bind(py).readonly();
        let depth = depth.as_array();
        let (height, width) = depth.dim();
        let (x, y, columns, rows) = region.unwrap_or((0, 0, width, height));
        let ends = (x.checked_add(columns), y.checked_add(rows));
        let (Some(right), Some(bottom)) = ends else {
            return Err(FarnearError::new_err(format!("region {:?} is too large", (x, y, columns, rows))));
        };
        if right > width || bottom > height {
            let message = format!(
                "region {:?} is outside the map of {width}x{height} px; expected column, row, width, height",
                (x, y, columns, rows)
            );
            return Err(FarnearError::new_err(message));
        }
        let lateral = measure::lateral(&self.optics.0, self.part.map(|place| place.0));
        let part = Rectangle { x, y, width: columns, height: rows };
        let plane = measure::fit(depth, lateral, part)
            .ok_or_else(|| FarnearError::new_err("fewer than three depths, or all in a line: no plane"))?;
        Ok(Plane {
            z_mm: plane.z_mm,
            slope_x: plane.slope_x,
            slope_y: plane.slope_y,
            tilt_deg: if lateral == Lateral::Unknown { f64::NAN } else { plane.tilt_deg },
            rms_mm: plane.rms_mm,
            peak_to_valley_mm: plane.peak_to_valley_mm,
        })
    }

    /// Principal distance, and column and row of the optical axis in the map, px; NaN for a lens without a scale.
    #[getter]
    fn _intrinsics_px(&self, py: Python<'_>) -> (f64, f64, f64) {
        let dim = self.depth_mm.bind(py).readonly().as_array().dim();
        match measure::lateral(&self.optics.0, self.part.map(|place| place.0)) {
            Lateral::Lens(lens) => {
                let [column, row] = lens.axis_in(dim);
                (lens.distance_mm / (1e-3 * lens.pixel_um), column, row)
            }
            Lateral::Pixel(_) | Lateral::Unknown => (f64::NAN, f64::NAN, f64::NAN),
        }
    }

    /// Plot the map with matplotlib: colours by depth in mm; returns the axes.
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(slf: &Bound<'py, Self>, ax: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("farnear.results")?.call_method1("plot", (slf, ax))
    }

    /// The maps as an `xarray.Dataset` with dimensions (row, column) and units; needs xarray.
    fn to_xarray<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("farnear.results")?.call_method1("to_xarray", (slf,))
    }

    /// Picture of the map for notebooks.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let png = PyBytes::new(py, &self.view_png(py)?);
        let text: String = py
            .import("base64")?
            .call_method1("b64encode", (png,))?
            .call_method1("decode", ("ascii",))?
            .extract()?;
        let title = self.__repr__(py).replace('<', "&lt;");
        Ok(format!(
            "<figure><img alt=\"depth map\" src=\"data:image/png;base64,{text}\"/><figcaption>{title}</figcaption></figure>"
        ))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let bind = |array: &Py<PyArray2<f32>>| array.bind(py).clone();
        let parts = (
            bind(&self.depth_mm),
            bind(&self.confidence),
            bind(&self.deviation_mm),
            self.reasons.bind(py).clone(),
            self.findings.clone(),
            self.valid_fraction,
            self.optics.clone(),
            self.part,
        );
        Ok((py.get_type::<Self>().getattr("_assemble")?, parts))
    }

    /// A map from its parts, for pickle.
    #[staticmethod]
    #[pyo3(signature = (depth_mm, confidence, deviation_mm, reasons, findings, valid_fraction, optics, part=None))]
    #[allow(clippy::too_many_arguments)] // the attributes
    fn _assemble(
        depth_mm: Bound<'_, PyArray2<f32>>,
        confidence: Bound<'_, PyArray2<f32>>,
        deviation_mm: Bound<'_, PyArray2<f32>>,
        reasons: Bound<'_, PyArray2<u8>>,
        findings: Vec<String>,
        valid_fraction: f64,
        optics: Optics,
        part: Option<Place>,
    ) -> Self {
        Self {
            depth_mm: depth_mm.unbind(),
            confidence: confidence.unbind(),
            deviation_mm: deviation_mm.unbind(),
            reasons: reasons.unbind(),
            findings,
            valid_fraction,
            optics,
            part,
        }
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let [height, width] = self.depth_mm.bind(py).shape() else { return "DepthMap()".into() };
        format!("DepthMap({height}x{width}, {:.1} % with a depth)", 100.0 * self.valid_fraction)
    }
}

/// Plane through a depth map, as `DepthMap.plane` returns it. Can be pickled and copied.
///
/// Attributes
/// ----------
/// z_mm : float
///     Distance from the lens in the middle of the points, mm.
/// slope_x, slope_y : float
///     Slopes to the right and upwards, mm per mm; mm per px for optics of `calibrate_stack` without `object_pixel_um`.
/// tilt_deg : float
///     Angle to a plane perpendicular to the optical axis, degrees; NaN if slopes are per px.
/// rms_mm : float
///     Root mean square distance of the points from the plane along the axis, mm.
/// peak_to_valley_mm : float
///     Largest minus smallest of these distances, mm.
#[pyclass(frozen, get_all, module = "farnear")]
pub struct Plane {
    z_mm: f64,
    slope_x: f64,
    slope_y: f64,
    tilt_deg: f64,
    rms_mm: f64,
    peak_to_valley_mm: f64,
}

/// Arguments of `Plane._assemble`.
type PlaneParts = (f64, f64, f64, f64, f64, f64);

#[pymethods]
impl Plane {
    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PlaneParts)> {
        let Self { z_mm, slope_x, slope_y, tilt_deg, rms_mm, peak_to_valley_mm } = *self;
        let parts = (z_mm, slope_x, slope_y, tilt_deg, rms_mm, peak_to_valley_mm);
        Ok((py.get_type::<Self>().getattr("_assemble")?, parts))
    }

    /// A plane from its parts, for pickle.
    #[staticmethod]
    fn _assemble(
        z_mm: f64,
        slope_x: f64,
        slope_y: f64,
        tilt_deg: f64,
        rms_mm: f64,
        peak_to_valley_mm: f64,
    ) -> Self {
        Self { z_mm, slope_x, slope_y, tilt_deg, rms_mm, peak_to_valley_mm }
    }

    fn __repr__(&self) -> String {
        let [z_mm, rms_mm] = [self.z_mm, self.rms_mm].map(|mm| rounded_for(self.rms_mm, mm, 3));
        format!("Plane({z_mm} mm, tilt {:.3} deg, rms {rms_mm} mm)", self.tilt_deg)
    }
}
