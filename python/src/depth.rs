//! Depth of pairs.

use farnear_depth::{
    adaptive_window::Window,
    fill::{FillBy, LowTexture},
    measure::{DepthMethod, MeasureSettings, measure_pair_of_views},
    operators,
    pipeline::{self, Settings},
    prepare::{Align, Balance, PrepareSettings},
    reason::Reason,
};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::{exceptions::PyTypeError, prelude::*};

use crate::{
    arrays::Image,
    errors::{FarnearError, wrong},
    optics::{Operators, Optics},
};

/// How regions of low texture are filled: not, as `farnear depth` does by itself, or by name.
pub struct Fill(Option<FillBy>);

impl<'py> FromPyObject<'_, 'py> for Fill {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(wanted) = object.extract::<bool>() {
            return Ok(Self(wanted.then(FillBy::default)));
        }
        let name = object.extract::<String>().map_err(|_| {
            PyTypeError::new_err(format!(
                "fill must be True, False, \"surface\" or \"thesis\", not {}",
                object.get_type()
            ))
        })?;
        name.parse().map(|by| Self(Some(by))).map_err(wrong)
    }
}

/// The run time's settings for what is to be filled, and by what it is told.
fn filling(fill: &Fill, low_texture: &str) -> PyResult<Settings> {
    let criterion: LowTexture = low_texture.parse().map_err(wrong)?;
    if fill.0.is_none() && criterion != LowTexture::default() {
        return Err(FarnearError::new_err(format!(
            "low_texture={low_texture:?} says what is filled: give fill=True or fill=\"thesis\" too"
        )));
    }
    let usual = Settings::default();
    Ok(Settings {
        fill: fill.0.is_some(),
        fill_by: fill.0.unwrap_or_default(),
        low_texture: criterion,
        ..usual
    })
}

/// A depth map with all that is known of it.
#[pyclass(frozen, get_all, module = "farnear")]
pub struct DepthMap {
    depth_mm: Py<PyArray2<f32>>,
    confidence: Py<PyArray2<f32>>,
    deviation_mm: Py<PyArray2<f32>>,
    reasons: Py<PyArray2<u8>>,
    findings: Vec<String>,
    valid_fraction: f64,
}

#[pymethods]
impl DepthMap {
    /// Why pixels have no depth: the numbers in `reasons`, in words.
    #[classattr]
    fn reason_words() -> std::collections::BTreeMap<u8, &'static str> {
        Reason::ALL.into_iter().map(|reason| (reason.code(), reason.words())).collect()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        use numpy::PyUntypedArrayMethods;
        let [height, width] = self.depth_mm.bind(py).shape() else { return "DepthMap()".into() };
        format!("DepthMap({height}x{width}, {:.1} % with a depth)", 100.0 * self.valid_fraction)
    }
}

#[pyfunction]
#[pyo3(signature = (far, near, optics, *, operators=None, method="ro", window=None, median_px=3, fill=Fill(None), low_texture="energy", align="auto",
                    balance="auto", min_confidence=0.0, threads=1))]
#[allow(clippy::too_many_arguments)] // keywords in Python
pub fn depth(
    py: Python<'_>,
    far: Image<'_>,
    near: Image<'_>,
    optics: &Optics,
    operators: Option<&Operators>,
    method: &str,
    window: Option<&Bound<'_, PyAny>>,
    median_px: usize,
    fill: Fill,
    low_texture: &str,
    align: &str,
    balance: &str,
    min_confidence: f32,
    threads: usize,
) -> PyResult<DepthMap> {
    if far.is_scaled() != near.is_scaled() {
        let message =
            "one image holds integers and the other float numbers: give both alike, or their scales differ";
        return Err(FarnearError::new_err(message));
    }
    let designed;
    let method = match (method, operators) {
        ("ro", Some(operators)) => DepthMethod::Rational(&operators.0),
        ("ro", None) => {
            designed = py.detach(|| operators::Operators::for_optics(&optics.0)).map_err(wrong)?;
            DepthMethod::Rational(&designed)
        }
        ("whitened", None) => DepthMethod::Whitened,
        (_, Some(_)) => return Err(FarnearError::new_err(format!("method {method:?} uses no operators"))),
        (other, None) => DepthMethod::Baseline(other.parse().map_err(|_| {
            let known = "ro, whitened, subbarao, subbarao-fourier or favaro";
            FarnearError::new_err(format!("there is no method {other:?}; expected {known}"))
        })?),
    };
    let window: Window = match window {
        Some(window) => window.to_string().parse().map_err(wrong)?,
        None if matches!(method, DepthMethod::Whitened) => Window::Adaptive,
        None => Window::Fixed(7),
    };
    let smoothing_px = if let Window::Fixed(side) = window { side } else { 7 };
    let settings = MeasureSettings {
        prepare: PrepareSettings {
            align: align.parse::<Align>().map_err(wrong)?,
            balance: balance.parse::<Balance>().map_err(wrong)?,
            limits: far.is_scaled().then_some([0.0, 1.0]),
            ..PrepareSettings::default()
        },
        window,
        run: Settings { smoothing_px, median_px, threads, ..filling(&fill, low_texture)? },
        least_confidence: min_confidence,
    };
    let (far, near) = (far.view(), near.view());
    let found =
        py.detach(|| measure_pair_of_views(far, near, &optics.0, method, None, &settings)).map_err(wrong)?;
    let validity = found.validity;
    Ok(DepthMap {
        depth_mm: found.map.depth_mm.into_pyarray(py).unbind(),
        confidence: found.map.confidence.into_pyarray(py).unbind(),
        deviation_mm: validity.deviation_mm.into_pyarray(py).unbind(),
        reasons: validity.reasons.into_pyarray(py).unbind(),
        findings: found.findings.iter().map(ToString::to_string).collect(),
        valid_fraction: validity.valid_fraction,
    })
}

/// Pair after pair with the bare run time.
#[pyclass(module = "farnear")]
pub struct Processor(pipeline::Processor);

#[pymethods]
impl Processor {
    #[new]
    #[pyo3(signature = (optics, *, operators=None, smoothing_px=7, median_px=3, fill=Fill(None), low_texture="energy", threads=1))]
    #[allow(clippy::too_many_arguments)] // keywords in Python
    fn new(
        py: Python<'_>,
        optics: &Optics,
        operators: Option<&Operators>,
        smoothing_px: usize,
        median_px: usize,
        fill: Fill,
        low_texture: &str,
        threads: usize,
    ) -> PyResult<Self> {
        let settings = Settings { smoothing_px, median_px, threads, ..filling(&fill, low_texture)? };
        let make = |operators: &operators::Operators| {
            pipeline::Processor::new(operators, &optics.0, &settings).map(Self).map_err(wrong)
        };
        match operators {
            Some(operators) => make(&operators.0),
            None => make(&py.detach(|| operators::Operators::for_optics(&optics.0)).map_err(wrong)?),
        }
    }

    #[allow(clippy::type_complexity)] // two arrays
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        far: PyReadonlyArray2<'py, f32>,
        near: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>)> {
        let (far, near) = (far.as_array(), near.as_array());
        let map = py.detach(|| self.0.run(far, near)).map_err(wrong)?;
        // The processor keeps its map for the next pair, so these are copies.
        Ok((PyArray2::from_array(py, &map.depth_mm), PyArray2::from_array(py, &map.confidence)))
    }
}
