//! Figures of depth maps: region with plane, profile, difference of two maps. Depth is in mm, um (stage positions) or
//! image numbers of a stack. Lateral positions in mm follow from the optics ([`Optics::projection_mm`]); a stack may give
//! the pixel size in its metadata; otherwise positions are in pixels.

mod difference;
mod map_file;
mod mesh;
mod plane;
mod profile;
mod region;
mod requests;
mod unit;

use std::path::Path;

use farnear_depth::optics::Optics;
use farnear_files::mesh::{Lateral, Projection};
use ndarray::{Array2, Array3, ArrayView2, s};
use serde::{Deserialize, Serialize};

pub(crate) use difference::read_two;
pub use difference::{DifferenceFigures, difference};
pub(crate) use map_file::{MapFile, read_map};
pub use mesh::mesh;
pub use plane::{Plane, PlaneFigures, fit};
pub use profile::{ProfileFigures, ProfilePoint, profile};
pub use region::{RegionFigures, region};
pub use requests::{
    MeasureDifferenceRequest, MeasurePlaneRequest, MeasureProfileRequest, MeasureRegionRequest, Pixel,
};
pub(crate) use unit::Entries;
pub use unit::Unit;

use crate::{
    depth::part::Part,
    error::{Result, WorkflowError},
};

/// Why some results of such a lens are refused.
pub(crate) const NO_SCALE: &str = "the lens was calibrated without the size of a pixel at the target: lateral positions \
     are not known in mm; calibrate the stack with --object-pixel-um";

/// A depth map with standard deviation (if computed) and lateral positions.
#[derive(Clone, Debug)]
pub struct Measured {
    /// (height, width); NaN = no value.
    pub depth: Array2<f32>,
    pub deviation: Option<Array2<f32>>,
    /// Unit of depth and deviation.
    pub unit: Unit,
    pub lateral: Lateral,
    /// On values of the file that mark holes or seem to.
    pub remarks: Vec<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

/// Column, row, width, height.
impl From<[usize; 4]> for Rectangle {
    fn from([x, y, width, height]: [usize; 4]) -> Self {
        Self { x, y, width, height }
    }
}

impl From<Rectangle> for [usize; 4] {
    fn from(Rectangle { x, y, width, height }: Rectangle) -> Self {
        [x, y, width, height]
    }
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("expected column, row, width and height in pixels, such as 100,80,320,240")]
pub struct NoRectangle;

impl std::fmt::Display for Rectangle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{},{},{},{}", self.x, self.y, self.width, self.height)
    }
}

impl std::str::FromStr for Rectangle {
    type Err = NoRectangle;

    fn from_str(text: &str) -> std::result::Result<Self, NoRectangle> {
        let numbers = text.split(',').map(|part| part.trim().parse().map_err(|_| NoRectangle));
        let numbers = numbers.collect::<std::result::Result<Vec<usize>, _>>()?;
        let [x, y, width, height] = numbers[..] else { return Err(NoRectangle) };
        Ok(Self { x, y, width, height })
    }
}

impl Measured {
    /// Reads the map of a result folder, or a map file: `.npy`, float TIFF, or the `depth.png` of a result.
    pub fn read(path: &Path) -> Result<Self> {
        map_file::read(path)
    }

    fn check(&self, at: &Rectangle) -> Result<()> {
        at.check_within(self.depth.dim())
    }

    pub fn all(&self) -> Rectangle {
        let (height, width) = self.depth.dim();
        Rectangle { x: 0, y: 0, width, height }
    }
}

/// Lateral positions in a map in mm; unknown for a lens that was calibrated without the size of a pixel at the target.
pub fn lateral(optics: &Optics, part: Option<Part>) -> Lateral {
    projection(optics, part).map_or(Lateral::Unknown, Lateral::Lens)
}

/// Of a focus stack: each pixel is taken from its sharpest image, whose sensor is where that object's image lies. So a pixel of
/// pitch p sees p (z - F) / F also of a lens that is not telecentric.
fn lateral_of_stack(optics: &Optics) -> Lateral {
    let focal_length_mm = optics.focal_length_mm();
    let front_focus = |lens| Projection { centre_mm: focal_length_mm, distance_mm: focal_length_mm, ..lens };
    projection(optics, None).map_or(Lateral::Unknown, |lens| Lateral::Lens(front_focus(lens)))
}

/// `None` where [`lateral()`] is unknown.
pub(crate) fn projection(optics: &Optics, part: Option<Part>) -> Option<Projection> {
    optics.stage().is_none_or(|stage| stage.scale_known).then(|| assumed_projection(optics, part))
}

/// By the nominal lens where it has no scale.
pub(crate) fn assumed_projection(optics: &Optics, part: Option<Part>) -> Projection {
    let [centre_mm, distance_mm] = optics.projection_mm();
    Projection { centre_mm, distance_mm, pixel_um: optics.pixel_um(), axis_px: axis_px(optics, part) }
}

/// The optical axis in a map, which is the centre of the lens' distortion; without that the middle of the images. `None`: the middle of
/// the map.
fn axis_px(optics: &Optics, part: Option<Part>) -> Option<[f64; 2]> {
    let Some(distortion) = optics.distortion() else { return part.map(|part| part.axis_px()) };
    let [x, y] = part.map_or([0.0; 2], |part| [part.x, part.y].map(|at| at as f64 / part.bin as f64));
    let [column, row] = distortion.centre_px();
    Some([column - x, row - y])
}

/// Object points of a depth map, (height, width, 3) in mm as in the mesh: right, up, towards the viewer. Fails where
/// [`lateral()`] is unknown.
pub fn points_mm(depth_mm: ArrayView2<f32>, optics: &Optics, part: Option<Part>) -> Result<Array3<f32>> {
    let dim = depth_mm.dim();
    let projection = projection(optics, part)
        .ok_or_else(|| WorkflowError::parameter("optics", "scale_known = false", NO_SCALE))?;
    let mut points = Array3::zeros((dim.0, dim.1, 3));
    for ((row, column), &z) in depth_mm.indexed_iter() {
        let [x, y] = projection.beside_axis_mm(dim, column, row, f64::from(z));
        for (place, value) in points.slice_mut(s![row, column, ..]).iter_mut().zip([x as f32, y as f32, -z]) {
            *place = if z.is_finite() { value } else { f32::NAN };
        }
    }
    Ok(points)
}

impl Rectangle {
    /// Fails outside an image of (height, width).
    pub fn check_within(&self, (height, width): (usize, usize)) -> Result<()> {
        let at = self;
        let fits = |begin: usize, size: usize, all: usize| {
            size > 0 && begin.checked_add(size).is_some_and(|end| end <= all)
        };
        if fits(at.x, at.width, width) && fits(at.y, at.height, height) {
            return Ok(());
        }
        let Rectangle { x, y, width: columns, height: rows } = at;
        let value = format!("{columns}x{rows} at ({x}, {y})");
        Err(WorkflowError::parameter("region", value, format!("expected a part of {width}x{height} pixels")))
    }
}

#[cfg(test)]
mod tests {
    use farnear_depth::optics::Stage;

    use super::*;

    #[test]
    fn points_need_the_size_of_a_pixel() {
        let optics: Optics = toml::from_str(
            "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
             [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n",
        )
        .unwrap();
        let depth = Array2::from_elem((3, 4), 900.0);
        let with = |scale_known| optics.with_stage(Stage { scale_known, ..Stage::identity(1, 1) });
        let points = |optics: &Optics| points_mm(depth.view(), optics, None);
        assert!(points(&optics).is_ok() && points(&with(true)).is_ok());
        let error = points(&with(false)).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("--object-pixel-um"), "{error}");
        assert_eq!(lateral(&with(false), None), Lateral::Unknown);
    }

    #[test]
    fn rays_meet_in_a_lens_that_is_not_telecentric() {
        let text =
            include_str!("../../../examples/rig.toml").replace("[lens]", "[lens]\ntelecentric = false");
        let optics: Optics = toml::from_str(&text).unwrap();
        let depth = ndarray::array![[890.0, 930.0, 890.0, 930.0]];
        let points = points_mm(depth.view(), &optics, None).unwrap();
        for (column, z) in depth.row(0).iter().enumerate() {
            // The sensor of the far image is 52.8313 mm behind the lens.
            let expected = 7.4e-3 * (column as f32 - 1.5) * z / 52.8313;
            assert!((points[(0, column, 0)] - expected).abs() < 1e-5, "{points}");
        }
        // Each pixel of a stack has its own sensor position.
        let Lateral::Lens(lens) = lateral_of_stack(&optics) else { panic!("a lens with a scale") };
        assert_eq!([lens.centre_mm, lens.distance_mm], [50.0; 2]);
    }

    #[test]
    fn the_axis_is_the_centre_of_the_distortion() {
        let optics = include_str!("../../../examples/rig.toml");
        let distortion = "[distortion]\ncamera_matrix = [[6700.0, 0, 30.5], [0, 6700.0, 20.0], [0, 0, 1]]\n\
                          coefficients = [-0.3, 0.1, 0.0, 0.0]\n";
        let optics: Optics = toml::from_str(&format!("{optics}{distortion}")).unwrap();
        let axis = |optics: &Optics, part| projection(optics, part).unwrap().axis_in((40, 53));
        let part = Part { x: 5, y: 2, image_width: 64, image_height: 48, bin: 1 };
        assert_eq!(axis(&optics, None), [30.5, 20.0]);
        assert_eq!(axis(&optics, Some(part)), [25.5, 18.0]);
        let averaged = Part { x: 0, y: 0, image_width: 107, image_height: 81, bin: 2 };
        assert_eq!(axis(&optics.binned(2), Some(averaged)), [15.0, 9.75]);
    }
}
