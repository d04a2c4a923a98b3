//! Points of a depth map in space.

use farnear_workflows::depth::part::Part;
use numpy::{IntoPyArray, PyArray3};
use pyo3::prelude::*;

use crate::{
    arrays::{Map, named, optics_named},
    depth_map::Place,
    errors::{FarnearError, wrong},
    work,
};

/// Object point that each pixel of a depth map sees.
///
/// Parameters
/// ----------
/// depth_mm : array (height, width)
///     Depth map, mm; NaN, or a depth within the focal length such as 0, where a pixel has none. With optics of
///     `calibrate_stack`, whose depths may be relative, NaN only.
/// optics : Optics
///     The optics of the map; those of `calibrate_stack` need its `object_pixel_um`.
/// part : (int, int, int, int) or (int, int, int, int, int), optional
///     `DepthMap.part`: column and row of the map in its images, width and height of these, px, and the pixels per side that were
///     averaged; by default the map shows whole images.
///
/// Returns
/// -------
/// array float32 (height, width, 3)
///     x to the right, y up, z towards the viewer, mm; the origin is the lens. NaN where there is no depth.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
/// >>> farnear.points_mm(np.full((4, 6), 900.0), optics).shape
/// (4, 6, 3)
#[pyfunction]
#[pyo3(signature = (depth_mm, optics, *, part=None))]
pub fn points_mm<'py>(
    py: Python<'py>,
    depth_mm: &Bound<'py, PyAny>,
    optics: &Bound<'py, PyAny>,
    part: Option<Place>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let depth_mm: Map<'py> = named("depth_mm", depth_mm)?;
    let optics = &*optics_named("optics", optics)?;
    // Integer maps mark holes by 0, and nothing within the focal length is imaged. `calibrate_stack` gives relative depths.
    let limit_mm = optics.0.stage().map_or(optics.0.focal_length_mm() as f32, |_| f32::NEG_INFINITY);
    let depth_mm = depth_mm.view().mapv(|mm| if mm > limit_mm { mm } else { f32::NAN });
    let part = part.map(|place| place.0);
    if let Some(part) = part.filter(|part| !part.fits(depth_mm.dim())) {
        let (rows, columns) = depth_mm.dim();
        let Part { x, y, image_width, image_height, bin } = part;
        return Err(FarnearError::new_err(format!(
            "part is {:?} for a map of {columns}x{rows} px; expected its column and row, width and height of the images, and the pixels \
             per side that were averaged",
            (x, y, image_width, image_height, bin)
        )));
    }
    let points = work::run(py, || farnear_workflows::measure::points_mm(depth_mm.view(), &optics.0, part))?;
    Ok(points.map_err(wrong)?.into_pyarray(py))
}
