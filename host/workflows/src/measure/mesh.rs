//! Coarse mesh of a captured surface.

use std::path::Path;

use farnear_files::{image_file::read_grey, mesh::ply};
use ndarray::s;

use super::Measured;
use crate::error::{Result, WorkflowError};

/// A PLY of at most `points` points (every n-th row and column), map's unit, coloured by the far or all-in-focus image.
pub fn mesh(folder: &Path, points: usize) -> Result<Vec<u8>> {
    let Measured { depth, lateral, unit, .. } = Measured::read(folder)?;
    let image = ["far.png", "all-in-focus.png"].map(|name| folder.join(name));
    let image = image.iter().find(|image| image.exists()).unwrap_or(&image[0]);
    let grey = read_grey(image)?.pixels;
    if grey.dim() != depth.dim() {
        let value = format!("{:?} rows and columns", depth.dim());
        let expected = format!("a map of the whole of {}", image.display());
        return Err(WorkflowError::parameter("depth.npy", value, expected));
    }
    let step = step(depth.len(), points);
    let window = s![..;step, ..;step];
    let lateral = lateral.thinned(depth.dim(), step);
    Ok(ply(depth.slice(window), grey.slice(window), lateral, &unit.to_string()))
}

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
