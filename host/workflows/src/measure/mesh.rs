//! The surface of a capture as a mesh, as coarse as it has to be.

use std::path::Path;

use farnear_files::{
    image_file::read_grey,
    mesh::{Projection, ply},
};
use ndarray::s;

use super::Measured;
use crate::error::{Result, WorkflowError};

/// A PLY of at most `points` points: every second, third, ... row and column of the map, coloured by the far image.
///
/// # Errors
/// [`crate::WorkflowError::Map`], [`crate::WorkflowError::Image`] where map or image are not there.
pub fn mesh(folder: &Path, points: usize) -> Result<Vec<u8>> {
    let Measured { depth_mm, projection, .. } = Measured::read(folder)?;
    let grey = read_grey(&folder.join("far.png"))?.pixels;
    if grey.dim() != depth_mm.dim() {
        let value = format!("{:?} rows and columns", depth_mm.dim());
        return Err(WorkflowError::parameter("depth.npy", value, "a map of the whole of far.png"));
    }
    let step = step(depth_mm.len(), points);
    let pitch = Projection {
        pixel_um: projection.pixel_um * step as f64,
        axis_px: projection.axis_px.map(|axis| axis.map(|place| place / step as f64)),
        ..projection
    };
    let window = s![..;step, ..;step];
    Ok(ply(depth_mm.slice(window), grey.slice(window), pitch))
}

/// The smallest step that leaves at most so many of `pixels`.
fn step(pixels: usize, points: usize) -> usize {
    (1..).find(|step| pixels / (step * step) <= points.max(1)).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::step;

    #[test]
    fn large_maps_are_thinned() {
        assert_eq!(
            [step(640 * 480, 100_000), step(320 * 240, 100_000), step(2048 * 1536, 100_000)],
            [2, 1, 6]
        );
        assert_eq!(step(0, 0), 1);
    }
}
