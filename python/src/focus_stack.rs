//! Depth from a focus stack.

use std::{
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use farnear_depth::{
    focus_stack::{Slices, StackError, StackSettings, depth_from_positions},
    prepare::align::Model,
};
use farnear_workflows::{
    Cancel, Context, Unattended,
    focus_stack::{depth_of_places, even_positions, prepare_stack, scarce},
};
use ndarray::{ArrayView2, CowArray, Ix2};
use numpy::{IntoPyArray, PyArray2};
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};

use crate::{
    arrays::stack_of,
    errors::{FarnearError, wrong},
    work,
};

/// Depth from a focus stack, as `focus_stack` returns it; arrays are float32 (height, width). Can be pickled and copied.
///
/// Attributes
/// ----------
/// depth : array float32
///     Object distance in mm, or the number of the sharpest image, from 1, if the distances were not given. NaN = unreliable.
/// unit : str
///     "mm" or "image".
/// reliability : array float32
///     How clear and how well fitted the maximum of sharpness is, 0 to 1.
/// all_in_focus : array float32
///     Each pixel from the image in which it is sharpest: 0 to 1 for uint8 and uint16, else in the scale of the images. 0 where no
///     image shows the pixel.
/// moved_px : float or None
///     Farthest that alignment moved a pixel, px; None without alignment.
/// left_out : list of int
///     Indices in `images` of those that were not used, see `findings`.
/// findings : list of str
///     What to know before trusting the map.
#[pyclass(frozen, get_all, module = "farnear")]
pub struct FocusStack {
    depth: Py<PyArray2<f32>>,
    unit: &'static str,
    reliability: Py<PyArray2<f32>>,
    all_in_focus: Py<PyArray2<f32>>,
    moved_px: Option<f64>,
    left_out: Vec<usize>,
    findings: Vec<String>,
}

/// Arguments of `FocusStack._assemble`.
type Parts<'py> = (
    Bound<'py, PyArray2<f32>>,
    &'static str,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Option<f64>,
    Vec<usize>,
    Vec<String>,
);

#[pymethods]
impl FocusStack {
    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let bind = |array: &Py<PyArray2<f32>>| array.bind(py).clone();
        let parts = (
            bind(&self.depth),
            self.unit,
            bind(&self.reliability),
            bind(&self.all_in_focus),
            self.moved_px,
            self.left_out.clone(),
            self.findings.clone(),
        );
        Ok((py.get_type::<Self>().getattr("_assemble")?, parts))
    }

    /// A result from its parts, for pickle.
    #[staticmethod]
    fn _assemble(
        depth: Bound<'_, PyArray2<f32>>,
        unit: &str,
        reliability: Bound<'_, PyArray2<f32>>,
        all_in_focus: Bound<'_, PyArray2<f32>>,
        moved_px: Option<f64>,
        left_out: Vec<usize>,
        findings: Vec<String>,
    ) -> Self {
        Self {
            depth: depth.unbind(),
            unit: unit_of(unit == "mm"),
            reliability: reliability.unbind(),
            all_in_focus: all_in_focus.unbind(),
            moved_px,
            left_out,
            findings,
        }
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        use numpy::PyUntypedArrayMethods;
        let [height, width] = self.depth.bind(py).shape() else { return "FocusStack()".into() };
        format!("FocusStack({height}x{width}, depth in {})", self.unit)
    }
}

fn unit_of(in_mm: bool) -> &'static str {
    if in_mm { "mm" } else { "image" }
}

/// Depth and all-in-focus image of a stack of images at different focus, as `farnear focus-stack` computes them.
///
/// Parameters
/// ----------
/// images : sequence of array (height, width)
///     At least three grey images of one size and one kind, in the order of their focus. NaN and black borders count as not
///     seen.
/// focused_at_mm : sequence of float, optional
///     Object distance in mm at which each image is sharp, ascending or descending.
/// measure : str
///     Focus measure, for example "modified-laplacian" or "tenengrad".
/// smoothing_px : float
///     Standard deviation of the Gaussian applied to the images first, px; 0 = none.
/// window_px : int
///     Side of the window of the focus measure, px, odd.
/// fit_points : int
///     Points of the sharpness curve that the maximum is fitted to, odd.
/// median_px : int
///     Side of the median filter, px, odd; 1 = none.
/// guided_px : float
///     Standard deviation of the edge-preserving filter, px; 0 = none.
/// min_reliability : float
///     Depths below this reliability are NaN, 0 to 1.
/// align : {"none", "shift", "similarity", "affine"}
///     Alignment of the images.
/// use_all : bool
///     Use all images, also those that show another scene, are turned or shaken.
///
/// Returns
/// -------
/// FocusStack
///     Depth in mm, reliability and all-in-focus image, each (height, width).
///
/// Examples
/// --------
/// >>> images = [np.random.default_rng(i).random((32, 32)) for i in range(3)]
/// >>> farnear.focus_stack(images, focused_at_mm=[300, 310, 320]).unit
/// 'mm'
#[pyfunction]
#[pyo3(signature = (images, *, focused_at_mm=None, measure="modified-laplacian", smoothing_px=1.0, window_px=9, fit_points=11, median_px=9,
                    guided_px=10.0, min_reliability=0.1, align="none", use_all=false))]
#[allow(clippy::too_many_arguments)] // keywords in Python
pub fn focus_stack<'py>(
    py: Python<'py>,
    images: Vec<Bound<'py, PyAny>>,
    focused_at_mm: Option<Vec<f64>>,
    measure: &str,
    smoothing_px: f32,
    window_px: usize,
    fit_points: usize,
    median_px: usize,
    guided_px: f32,
    min_reliability: f32,
    align: &str,
    use_all: bool,
) -> PyResult<FocusStack> {
    if !(0.0..=1.0).contains(&min_reliability) {
        return Err(FarnearError::new_err(format!("min_reliability is {min_reliability}; expected 0 to 1")));
    }
    if let Some(distances) = &focused_at_mm {
        check_distances(distances, images.len())?;
    }
    let model: Option<Model> = match align {
        "none" => None,
        "shift" => Some(Model::Shift),
        "similarity" => Some(Model::Similarity),
        "affine" => Some(Model::Affine),
        other => {
            let message = format!("align is {other:?}; expected none, shift, similarity or affine");
            return Err(FarnearError::new_err(message));
        }
    };
    let settings = StackSettings {
        measure: measure.parse().map_err(wrong)?,
        smoothing_px,
        window_px,
        fit_points,
        median_px,
        guided_px,
        min_reliability,
    };
    let (images, full_scale) = stack_of(&images)?;
    let in_mm = focused_at_mm.is_some();
    let positions = even_positions(images.len(), focused_at_mm.as_deref());
    let code_step = full_scale.map_or(0.0, f32::recip);
    let (map, depth, prepared) = work::interruptibly(py, |stop| -> PyResult<_> {
        let context = Context::new(&Unattended, &Unattended, Cancel::from(Arc::clone(stop)));
        let prepared =
            prepare_stack(images, code_step, positions, model, use_all, &context).map_err(wrong)?;
        let views: Vec<ArrayView2<'_, f32>> = prepared.images.iter().map(|image| image.view()).collect();
        let stack = Stoppable { views, code_step: prepared.code_step, stop };
        let mut map = depth_from_positions(&stack, &prepared.positions, &settings)
            .map_err(|Stopped(error)| error.map_or_else(|| PyKeyboardInterrupt::new_err(()), wrong))?;
        prepared.withhold(&mut map);
        let depth = depth_of_places(&map.place, &prepared.positions, in_mm);
        Ok((map, depth, prepared))
    })??;
    let findings = prepared.warnings.into_iter().chain(scarce(&depth, &map)).collect();
    Ok(FocusStack {
        depth: depth.into_pyarray(py).unbind(),
        unit: unit_of(in_mm),
        reliability: map.reliability.into_pyarray(py).unbind(),
        all_in_focus: map.all_in_focus.into_pyarray(py).unbind(),
        moved_px: prepared.moved_px,
        left_out: prepared.left_out,
        findings,
    })
}

/// No map: for this reason, or because it was stopped.
struct Stopped(Option<StackError>);

impl From<StackError> for Stopped {
    fn from(error: StackError) -> Self {
        Self(Some(error))
    }
}

/// Images whose reading fails once `stop` is set.
struct Stoppable<'a> {
    views: Vec<ArrayView2<'a, f32>>,
    code_step: f32,
    stop: &'a AtomicBool,
}

impl Slices for Stoppable<'_> {
    type Error = Stopped;

    fn count(&self) -> usize {
        self.views.len()
    }

    fn dim(&self, index: usize) -> (usize, usize) {
        self.views[index].dim()
    }

    fn rows(&self, index: usize, rows: Range<usize>) -> Result<CowArray<'_, f32, Ix2>, Stopped> {
        self.measured(0, 0)?;
        Ok(self.views[..].rows(index, rows)?)
    }

    fn code_step(&self) -> f32 {
        self.code_step
    }

    fn measured(&self, _: usize, _: usize) -> Result<(), Stopped> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Stopped(None)),
            false => Ok(()),
        }
    }
}

fn check_distances(distances: &[f64], images: usize) -> PyResult<()> {
    if distances.len() != images {
        return Err(FarnearError::new_err(format!(
            "focused_at_mm has {} distances for {images} images",
            distances.len()
        )));
    }
    if let Some(wrong) = distances.iter().find(|mm| !(mm.is_finite() && **mm > 0.0)) {
        return Err(FarnearError::new_err(format!(
            "focused_at_mm holds {wrong}; expected distances in mm above 0"
        )));
    }
    let (up, down) =
        (distances.windows(2).all(|two| two[0] < two[1]), distances.windows(2).all(|two| two[0] > two[1]));
    if !up && !down {
        return Err(FarnearError::new_err(
            "focused_at_mm must ascend or descend: sort the images by their focus",
        ));
    }
    Ok(())
}
