//! Synthetic silhouettes of people.

use farnear_recognition::synthetic::activities::{ACTIVITIES, performance};
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::silhouette::view::{Canvas, View, draw, extent};
use ndarray::{Array3, Axis};
use numpy::{IntoPyArray, PyArray3};
use pyo3::prelude::*;

use crate::{errors::FarnearError, work};

const MM_PER_PX: f64 = 10.0;
const MARGIN_PX: usize = 2;

/// Silhouettes of a synthetic person.
///
/// Parameters
/// ----------
/// activity : str
///     walk, drop, crouch, peer, mobile, place, bag, shoot, gun or dig.
/// subject : int
///     Number of the person; the same number is always the same person.
/// azimuth_deg : float
///     Direction of view, degrees; 0 = from the front.
/// rate_hz : float
///     Frames per second, 1 to 1000.
///
/// Returns
/// -------
/// array bool (frames, height, width)
///     Masks, 10 mm a pixel.
///
/// Examples
/// --------
/// >>> farnear.synthetic_masks("walk").ndim
/// 3
#[pyfunction]
#[pyo3(signature = (activity, *, subject=0, azimuth_deg=90.0, rate_hz=15.0))]
pub fn synthetic_masks<'py>(
    py: Python<'py>,
    activity: &str,
    subject: usize,
    azimuth_deg: f64,
    rate_hz: f64,
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let Some(number) = ACTIVITIES.iter().position(|name| *name == activity) else {
        let known = ACTIVITIES.join(", ");
        return Err(FarnearError::new_err(format!(
            "there is no activity {activity:?}; expected one of {known}"
        )));
    };
    if !azimuth_deg.is_finite() {
        return Err(FarnearError::new_err(format!("azimuth_deg is {azimuth_deg}; expected an angle")));
    }
    if !(1.0..=1000.0).contains(&rate_hz) {
        return Err(FarnearError::new_err(format!("rate_hz = {rate_hz} is not in 1 to 1000")));
    }
    let frames = work::watched(py, move || {
        let bodies = performance(subject, number, 0, rate_hz);
        let view = View { alpha_deg: 0.0, beta_deg: 0.0, gamma_deg: azimuth_deg };
        let reach: Vec<_> = bodies.iter().flat_map(|body| extent(body, &view)).collect();
        let canvas = Canvas::fitting(&reach, MM_PER_PX, MARGIN_PX)?;
        let masks: Vec<Mask> = bodies.iter().map(|body| draw(body, &view, &canvas)).collect();
        let views: Vec<_> = masks.iter().map(|mask| mask.view().insert_axis(Axis(0))).collect();
        ndarray::concatenate(Axis(0), &views).ok()
    })?;
    Ok(frames.unwrap_or_else(|| Array3::default((0, 0, 0))).into_pyarray(py))
}
