//! Figures of a depth map: a region with the plane through it, a profile, the difference of two maps, over time.
//!
//! A pixel of pitch p sees p (z - F) / F of the object at distance z (telecentric lens, see `farnear_files::mesh`), which gives
//! positions beside the optical axis in mm.

mod difference;
mod mesh;
mod plane;
mod profile;
mod region;

use std::{fs, path::Path};

use farnear_depth::{metrics::is_depth, optics::Optics};
use farnear_files::{map, mesh::Projection};
use ndarray::{Array2, Array3, ArrayView2, s};
use serde::{Deserialize, Serialize};

pub use difference::{DifferenceFigures, difference};
pub use mesh::mesh;
pub use plane::{Plane, fit};
pub use profile::{ProfileFigures, ProfilePoint, profile};
pub use region::{RegionFigures, region};

use crate::{
    depth::part::Part,
    error::{Result, WorkflowError},
    optics,
};

/// A depth map with its standard deviation, where that was computed, and where its rays go.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Depths in mm, (height, width); NaN = no value.
    pub depth_mm: Array2<f32>,
    /// Standard deviation of each depth, mm.
    pub deviation_mm: Option<Array2<f32>>,
    /// Where a pixel's ray goes.
    pub projection: Projection,
}

/// What of the record beside a map is needed here.
#[derive(Deserialize)]
struct Record {
    optics: Optics,
    part: Option<Part>,
}

/// Unit of a depth map by the stack.toml next to it: `mm`, `um` or `image`; `mm` without one.
///
/// # Errors
/// A stack.toml that cannot be read.
pub fn unit_of(map: &Path) -> Result<String> {
    #[derive(Deserialize)]
    struct Stack {
        unit: String,
    }
    let record = map.parent().unwrap_or(Path::new(".")).join("stack.toml");
    if !record.exists() {
        return Ok("mm".into());
    }
    let text = fs::read_to_string(&record).map_err(WorkflowError::read("the stack's record", &record))?;
    let Stack { unit } =
        toml::from_str(&text).map_err(WorkflowError::file(&record, "a record of a focus stack"))?;
    Ok(unit)
}

/// The optics that made the map of a folder: its record's, else the pair's; and which part of the images it is of.
fn optics_of(folder: &Path) -> Result<(Optics, Option<Part>)> {
    let record = folder.join("depth.toml");
    if !record.exists() {
        return Ok((optics::of_pair(None, &folder.join("far.png"))?.0, None));
    }
    let text = fs::read_to_string(&record).map_err(WorkflowError::read("the map's record", &record))?;
    let Record { optics, part } =
        toml::from_str(&text).map_err(WorkflowError::file(&record, "a record of a depth map"))?;
    Ok((optics, part))
}

/// A rectangle of pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

/// A text that names no rectangle.
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
    /// Reads what [`crate::depth::compute`] wrote: a folder, or a map in it.
    ///
    /// # Errors
    /// [`WorkflowError::Map`] where there is no `depth.npy`, [`WorkflowError::NoOptics`]; [`WorkflowError::File`] for a
    /// deviation of another size.
    pub fn read(capture: &Path) -> Result<Self> {
        let file = if capture.is_dir() { capture.join("depth.npy") } else { capture.to_owned() };
        let folder = file.parent().unwrap_or(Path::new("."));
        let unit = unit_of(&file)?;
        if unit != "mm" {
            return Err(WorkflowError::parameter(
                "depth.npy",
                format!("depths in {unit}"),
                "a map in mm: measure the stack with --distances-mm or --sensor-mm, for figures are in mm",
            ));
        }
        // 0, negative values and infinity are holes in maps of many sources.
        let depth_mm = map::read(&file)?.mapv(|z| if is_depth(z) { z } else { f32::NAN });
        let path = folder.join("uncertainty.npy");
        let deviation_mm = path.exists().then(|| map::read(&path)).transpose()?;
        if let Some(deviation) = deviation_mm.as_ref().filter(|map| map.dim() != depth_mm.dim()) {
            let reason =
                format!("{:?} rows and columns, depth.npy has {:?}", deviation.dim(), depth_mm.dim());
            return Err(WorkflowError::file(&path, "a map of the depth's size")(reason));
        }
        let (optics, part) = optics_of(folder)?;
        let projection = Projection {
            focal_length_mm: optics.focal_length_mm(),
            pixel_um: optics.pixel_um(),
            axis_px: part.map(|part| part.axis_px()),
        };
        Ok(Self { depth_mm, deviation_mm, projection })
    }

    /// Where the pixel sees the object, mm: to the right, up, away from the lens. `None` where there is no depth.
    pub fn point_mm(&self, column: usize, row: usize) -> Option<[f64; 3]> {
        let z = f64::from(*self.depth_mm.get((row, column))?);
        let [x, y] = self.projection.beside_axis_mm(self.depth_mm.dim(), column, row, z);
        z.is_finite().then_some([x, y, z])
    }

    fn check(&self, at: &Rectangle) -> Result<()> {
        at.check_within(self.depth_mm.dim())
    }
}

/// The point of the object that each pixel of a whole depth map (mm) sees, (height, width, 3) in mm as in the mesh: to the right, up, towards
/// the viewer, from the lens; NaN where there is no depth.
pub fn points_mm(depth_mm: ArrayView2<f32>, optics: &Optics) -> Array3<f32> {
    let dim = depth_mm.dim();
    let projection =
        Projection { focal_length_mm: optics.focal_length_mm(), pixel_um: optics.pixel_um(), axis_px: None };
    let mut points = Array3::zeros((dim.0, dim.1, 3));
    for ((row, column), &z) in depth_mm.indexed_iter() {
        let [x, y] = projection.beside_axis_mm(dim, column, row, f64::from(z));
        for (place, value) in points.slice_mut(s![row, column, ..]).iter_mut().zip([x as f32, y as f32, -z]) {
            *place = if z.is_finite() { value } else { f32::NAN };
        }
    }
    points
}

impl Rectangle {
    /// # Errors
    /// [`WorkflowError::Parameter`] unless it is a part of an image of (height, width).
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
