//! Sun, shadow and silhouette descriptors.

use farnear_recognition::embedding::descriptor::{self, Scaling};
use farnear_shadow::sun::{self, Model, Place, SunPosition};
use farnear_shadow::{self as shadow, CameraFile, Method};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::{prelude::*, types::PyDict};

use crate::{
    arrays::{Mask, named},
    errors::{FarnearError, wrong},
};

/// Position of the sun, without refraction.
///
/// Parameters
/// ----------
/// time : str or datetime.datetime
///     Time with its time zone.
/// latitude_deg, longitude_deg : float
///     Place, degrees; north and east are positive.
/// model : {"psa", "almanac", "thesis", "spa"}
///     Formulas: PSA+, an almanac, the thesis, or NREL's SPA.
///
/// Returns
/// -------
/// elevation_deg, azimuth_deg : float
///     Elevation above the horizon, and azimuth clockwise from north, degrees.
///
/// Examples
/// --------
/// >>> elevation_deg, azimuth_deg = farnear.sun_position("2014-06-23T11:30:00Z", 52.38, -1.56)
/// >>> round(elevation_deg)
/// 60
#[pyfunction]
#[pyo3(signature = (time, latitude_deg, longitude_deg, *, model="psa"))]
pub fn sun_position(
    time: &Bound<'_, PyAny>,
    latitude_deg: f64,
    longitude_deg: f64,
    model: &str,
) -> PyResult<(f64, f64)> {
    let text = match time.call_method0("isoformat") {
        Ok(text) => text.extract::<String>()?,
        Err(_) => time.extract()?,
    };
    let time = sun::parse_time(&text).map_err(wrong)?;
    let model: Model = model.parse().map_err(wrong)?;
    let place = Place::new(latitude_deg, longitude_deg).map_err(wrong)?;
    let sun = sun::position(time, place, model).map_err(wrong)?;
    Ok((sun.elevation_deg, sun.azimuth_deg))
}

/// Remove the shadow of the one person in a mask.
///
/// Parameters
/// ----------
/// mask : array bool or uint8 (height, width)
///     Person with shadow; 0 = background.
/// camera : str
///     Text of a camera file (`farnear shadow remove --help`).
/// elevation_deg, azimuth_deg : float
///     Position of the sun, degrees.
/// method : {"hybrid", "thesis"}
///     How the shadow is cut.
///
/// Returns
/// -------
/// mask : array bool (height, width)
///     The person without shadow.
/// report : dict
///     `beta_deg`, `removed_fraction`, `distance_m` of the person, and whether the cut is `trustworthy`.
#[pyfunction]
#[pyo3(signature = (mask, camera, *, elevation_deg, azimuth_deg, method="hybrid"))]
pub fn remove_shadow<'py>(
    py: Python<'py>,
    mask: &Bound<'py, PyAny>,
    camera: &str,
    elevation_deg: f64,
    azimuth_deg: f64,
    method: &str,
) -> PyResult<(Bound<'py, PyArray2<bool>>, Bound<'py, PyDict>)> {
    let mask: Mask = named("mask", mask)?;
    if !(-90.0..=90.0).contains(&elevation_deg) {
        return Err(FarnearError::new_err(format!("elevation_deg is {elevation_deg}; expected -90 to 90")));
    }
    if !azimuth_deg.is_finite() {
        return Err(FarnearError::new_err(format!("azimuth_deg is {azimuth_deg}; expected an angle")));
    }
    let file = CameraFile::parse(camera).map_err(wrong)?;
    let method: Method = method.parse().map_err(FarnearError::new_err::<String>)?;
    let sun = SunPosition { elevation_deg, azimuth_deg };
    let cut = || shadow::remove(&mask.0, &file, sun, 0.0, method);
    let (clean, report) = py.detach(cut).map_err(wrong)?;
    let dict = PyDict::new(py);
    dict.set_item("beta_deg", report.beta_rad.to_degrees())?;
    dict.set_item("removed_fraction", report.removed_fraction)?;
    dict.set_item("distance_m", report.subject.distance_m)?;
    dict.set_item("trustworthy", report.trustworthy)?;
    Ok((clean.into_pyarray(py), dict))
}

/// Centroid distances of a silhouette: its descriptor; takes 20 us.
///
/// Parameters
/// ----------
/// mask : array bool or uint8 (height, width)
///     The silhouette, px; 0 = background.
/// scaling : {"keep-aspect", "stretch"}
///     How the silhouette is scaled to the frame.
///
/// Returns
/// -------
/// array float32 (360,)
///     Distance from the centroid to the outermost pixel, one a degree anticlockwise from the right, in units of the frame's side.
///
/// Examples
/// --------
/// >>> farnear.centroid_distance(np.ones((40, 20), bool)).shape
/// (360,)
#[pyfunction]
#[pyo3(signature = (mask, *, scaling="keep-aspect"))]
pub fn centroid_distance<'py>(
    py: Python<'py>,
    mask: &Bound<'py, PyAny>,
    scaling: &str,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let mask: Mask = named("mask", mask)?;
    let scaling = match scaling {
        "keep-aspect" => Scaling::KeepAspect,
        "stretch" => Scaling::Stretch,
        other => {
            let message = format!("there is no scaling {other:?}; expected keep-aspect or stretch");
            return Err(FarnearError::new_err(message));
        }
    };
    let found = py.detach(|| descriptor::centroid_distance(mask.0.view(), scaling)).map_err(wrong)?;
    Ok(found.to_vec().into_pyarray(py))
}
