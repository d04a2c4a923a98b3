//! A lens from a z-stack of a flat target.

use std::sync::atomic::Ordering;

use farnear_depth::calibrate::stack::{self, Moved, StackSettings};
use farnear_workflows::{
    calibrate::stack::{curved_light, filled_pixels, raw_mosaic, verdict},
    figures::rounded_for,
    focus_stack::fill_specks,
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use crate::{
    arrays::stack_of,
    errors::{FarnearError, wrong},
    optics::Optics,
    work,
};

/// Lens calibrated by `calibrate_stack`; errors are those on parts of the target that were left out of the fit. Can be pickled
/// and copied.
///
/// Attributes
/// ----------
/// optics : Optics
///     The lens, for `depth`.
/// verdict : str
///     "good", or what to change.
/// findings : list of str
///     What to know before trusting the lens.
/// pair_step : int
///     Slices from the far to the near image of a pair.
/// bin : int
///     Pixels per side that are averaged into one.
/// robust_mm, rms_mm, bias_mm : float
///     1.4826 times the median, root mean square and mean of the error, mm.
/// slope : float
///     Slope of measured over true depth.
/// fill : float
///     Part of the pixels with a depth, 0 to 1.
/// within_three : float
///     Part of the errors within three predicted standard deviations, 0 to 1.
/// by_depth : array (n, 4), float64
///     Rows of normalised depth (-1 far plane, 1 near plane), mean error, root mean square error and predicted standard deviation, mm.
/// response : array (m, 2), float64
///     Rows of measured and true normalised depth: the correction that `depth` applies.
#[pyclass(frozen, get_all, module = "farnear")]
pub struct StackFit {
    optics: Optics,
    verdict: String,
    findings: Vec<String>,
    pair_step: usize,
    bin: usize,
    robust_mm: f64,
    rms_mm: f64,
    bias_mm: f64,
    slope: f64,
    fill: f64,
    within_three: f64,
    by_depth: Py<PyArray2<f64>>,
    response: Py<PyArray2<f64>>,
}

/// Arguments of `StackFit._assemble`.
type Parts<'py> =
    (Optics, String, Vec<String>, [usize; 2], [f64; 6], Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

#[pymethods]
impl StackFit {
    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let parts = (
            self.optics.clone(),
            self.verdict.clone(),
            self.findings.clone(),
            [self.pair_step, self.bin],
            [self.robust_mm, self.rms_mm, self.bias_mm, self.slope, self.fill, self.within_three],
            self.by_depth.bind(py).clone(),
            self.response.bind(py).clone(),
        );
        Ok((py.get_type::<Self>().getattr("_assemble")?, parts))
    }

    /// A fit from its parts, for pickle.
    #[staticmethod]
    fn _assemble(
        optics: Optics,
        verdict: String,
        findings: Vec<String>,
        steps: [usize; 2],
        errors: [f64; 6],
        by_depth: Bound<'_, PyArray2<f64>>,
        response: Bound<'_, PyArray2<f64>>,
    ) -> Self {
        let [pair_step, bin] = steps;
        let [robust_mm, rms_mm, bias_mm, slope, fill, within_three] = errors;
        Self {
            optics,
            verdict,
            findings,
            pair_step,
            bin,
            robust_mm,
            rms_mm,
            bias_mm,
            slope,
            fill,
            within_three,
            by_depth: by_depth.unbind(),
            response: response.unbind(),
        }
    }

    fn __repr__(&self) -> String {
        format!(
            "StackFit(pairs {} slices apart, {} mm RMS, {})",
            self.pair_step,
            rounded_for(self.rms_mm, self.rms_mm, 4),
            self.verdict
        )
    }
}

/// Calibrate a lens from a z-stack of a flat, textured target, tilted or not, as `farnear calibrate stack` does.
///
/// Parameters
/// ----------
/// images : sequence of array (height, width)
///     Slices of one size and one kind, one stage step apart, the one with the farthest focus first.
/// step_mm : float
///     Distance between neighbouring slices, mm (0.5 um is 0.0005). Steps in degrees, dioptres or volts give depths in that unit.
/// object_pixel_um : float, optional
///     Side of a pixel at the target, um; without it point clouds have any scale.
/// far_mm : float, optional
///     Distance of the far-focused plane of a pair, mm; without it depth is relative.
/// pair_step : int, optional
///     Slices from the far to the near image of a pair; by default for a largest blur of 2 to 3 px.
/// bin : int, optional
///     Pixels per side that are averaged into one; by default chosen with `pair_step`.
///
/// Returns
/// -------
/// StackFit
///     With `optics`, `verdict` and errors in mm. Pairs are `images[i]` (far) and `images[i + pair_step]` (near), for `method="whitened"`.
///
/// Raises
/// ------
/// FarnearError
///     Too few slices, slices of two sizes or kinds, no focus, blur that is too small.
#[pyfunction]
#[pyo3(signature = (images, *, step_mm, object_pixel_um=None, far_mm=None, pair_step=None, bin=None))]
pub fn calibrate_stack<'py>(
    py: Python<'py>,
    images: Vec<Bound<'py, PyAny>>,
    step_mm: f64,
    object_pixel_um: Option<f64>,
    far_mm: Option<f64>,
    pair_step: Option<usize>,
    bin: Option<usize>,
) -> PyResult<StackFit> {
    let (mut slices, full_scale) = stack_of(&images)?;
    let mut filled = 0;
    for (index, slice) in slices.iter_mut().enumerate() {
        filled += fill_specks(slice, full_scale.is_none()).len();
        if let Some(((row, column), _)) = slice.indexed_iter().find(|(_, value)| !value.is_finite()) {
            return Err(FarnearError::new_err(format!(
                "images[{index}]: the pixel in column {column}, row {row} has no value: crop or fill it"
            )));
        }
    }
    let settings = StackSettings {
        step_mm,
        moved: Moved::Target { object_pixel_um, far_mm },
        pair_step,
        bin,
        coding: 0.0,
    };
    let found = work::interruptibly(py, |stop| {
        stack::calibrate_stack(&slices, &settings, &|_| !stop.load(Ordering::Relaxed))
    })?
    .map_err(wrong)?;
    let stage = found.optics.stage().ok_or_else(|| FarnearError::new_err("the stack gives no pairs"))?;
    let held_out = &found.held_out;
    let rows: Vec<[f64; 4]> =
        held_out.by_depth.iter().map(|at| [at.depth, at.bias_mm, at.rms_mm, at.predicted_mm]).collect();
    let by_depth = Array2::from(rows);
    Ok(StackFit {
        verdict: verdict(&found),
        findings: [raw_mosaic(&slices[0]), filled_pixels(filled), curved_light(&found, &slices)]
            .into_iter()
            .flatten()
            .collect(),
        pair_step: stage.pair_step,
        bin: stage.bin,
        robust_mm: held_out.robust_mm,
        rms_mm: held_out.rms_mm,
        bias_mm: held_out.bias_mm,
        slope: held_out.slope,
        fill: held_out.fill,
        within_three: held_out.within_three,
        by_depth: by_depth.into_pyarray(py).unbind(),
        response: Array2::from(stage.curve().to_vec()).into_pyarray(py).unbind(),
        optics: found.optics.into(),
    })
}
