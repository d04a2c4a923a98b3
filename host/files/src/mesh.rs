//! The surface as a mesh: binary PLY, as MeshLab, CloudCompare and Blender read it.
//!
//! The aperture stands in the front focal plane, so the chief ray of an object point at distance z from the lens goes
//! through the front focus: a pixel of pitch p sees p (z - F) / F of the object, wherever the sensor stands. x to the
//! right, y up, z towards the viewer; all in mm.

use std::io::{self, Write};

use ndarray::ArrayView2;

/// Neighbours that differ by more than this part of the map's range belong to different surfaces.
const STEP: f32 = 0.1;

/// What of the optics decides where a pixel's ray goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Projection {
    /// Focal length of the lens.
    pub focal_length_mm: f64,
    /// Pitch of the pixels.
    pub pixel_um: f64,
    /// Column and row at which the optical axis meets the map; without it its middle.
    pub axis_px: Option<[f64; 2]>,
}

impl Projection {
    /// Column and row at which the optical axis meets a map of (height, width).
    pub fn axis_in(&self, (height, width): (usize, usize)) -> [f64; 2] {
        self.axis_px.unwrap_or([width, height].map(|n| 0.5 * (n as f64 - 1.0)))
    }

    /// Where a pixel of a map of size `dim` sees the object `z` mm from the lens, beside the optical axis: to the right and up, mm.
    pub fn beside_axis_mm(&self, dim: (usize, usize), column: usize, row: usize, z: f64) -> [f64; 2] {
        let axis = self.axis_in(dim);
        let scale = self.pixel_um * 1e-3 * (z / self.focal_length_mm - 1.0);
        [(column as f64 - axis[0]) * scale, (axis[1] - row as f64) * scale]
    }
}

/// Number of a place without a vertex.
const NONE: u32 = u32::MAX;

/// The mesh of `depth_mm`, coloured by `grey` (any scale), row by row into a file: 12 MP are half a gigabyte, which no memory
/// is to hold.
///
/// # Errors
/// What the system says.
pub fn write(
    depth_mm: ArrayView2<f32>,
    grey: ArrayView2<f32>,
    projection: Projection,
    to: &mut impl Write,
) -> io::Result<()> {
    let (height, width) = depth_mm.dim();
    let finite = || depth_mm.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite().fold((f32::MAX, f32::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let step = (high - low) * STEP;
    let brightest = grey.iter().copied().filter(|value| value.is_finite()).fold(1e-9, f32::max);

    let vertices = finite().count();
    let mut faces = 0_usize;
    for row in 1..height {
        each_face(depth_mm, row, step, |_| {
            faces += 1;
            Ok(())
        })?;
    }
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\ncomment depth map in mm\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )?;
    for ((row, column), &z) in depth_mm.indexed_iter().filter(|(_, z)| z.is_finite()) {
        let [x, y] = projection.beside_axis_mm((height, width), column, row, f64::from(z));
        let shade = (255.0 * (grey[[row, column]] / brightest).clamp(0.0, 1.0)).round() as u8;
        let mut vertex = [shade; 15];
        for (place, value) in vertex.chunks_exact_mut(4).zip([x as f32, y as f32, -z]) {
            place.copy_from_slice(&value.to_le_bytes());
        }
        to.write_all(&vertex)?;
    }
    // Vertices are numbered as they come, so that two rows of numbers are enough.
    let mut next = 0;
    let mut numbers = [vec![NONE; width], vec![NONE; width]];
    for row in 0..height {
        numbers.swap(0, 1);
        for (number, z) in numbers[1].iter_mut().zip(depth_mm.row(row)) {
            *number = if z.is_finite() { next } else { NONE };
            next += u32::from(z.is_finite());
        }
        if row == 0 {
            continue;
        }
        each_face(depth_mm, row, step, |corners| {
            let mut face = [3_u8; 13];
            for (place, (down, column)) in face[1..].chunks_exact_mut(4).zip(corners) {
                place.copy_from_slice(&numbers[down][column].to_le_bytes());
            }
            to.write_all(&face)
        })?;
    }
    Ok(())
}

/// The same as bytes, for what is thinned first.
pub fn ply(depth_mm: ArrayView2<f32>, grey: ArrayView2<f32>, projection: Projection) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(depth_mm, grey, projection, &mut bytes).unwrap_or_else(|_| unreachable!("memory takes all bytes"));
    bytes
}

/// The triangles between the row before `row` and this one, each as (0 = upper, 1 = lower row; column) of its corners.
fn each_face(
    depth_mm: ArrayView2<f32>,
    row: usize,
    step: f32,
    mut face: impl FnMut([(usize, usize); 3]) -> io::Result<()>,
) -> io::Result<()> {
    let rows = [depth_mm.row(row - 1), depth_mm.row(row)];
    for column in 0..depth_mm.ncols().saturating_sub(1) {
        let right = column + 1;
        for corners in [[(0, column), (1, column), (0, right)], [(0, right), (1, column), (1, right)]] {
            let z = corners.map(|(down, column)| rows[down][column]);
            let spread =
                z.iter().fold(f32::MIN, |a, b| a.max(*b)) - z.iter().fold(f32::MAX, |a, b| a.min(*b));
            if z.iter().all(|z| z.is_finite()) && spread <= step {
                face(corners)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn holes_have_no_vertices_and_steps_no_faces() {
        let depth = array![[900.0f32, 900.1, f32::NAN], [900.2, 900.1, 890.0]];
        let projection = Projection { focal_length_mm: 50.0, pixel_um: 7.4, axis_px: None };
        let bytes = ply(depth.view(), depth.view(), projection);
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains("element vertex 5\n"), "{text}");
        assert!(text.contains("element face 2\n"), "{text}");
        let header = text.find("end_header\n").unwrap() + "end_header\n".len();
        assert_eq!(bytes.len(), header + 5 * 15 + 2 * 13);
        let faces = &bytes[header + 5 * 15..];
        let corners = |face: &[u8]| -> Vec<u32> {
            face[1..].chunks(4).map(|number| u32::from_le_bytes(number.try_into().unwrap())).collect()
        };
        // 0 1 . above 2 3 4.
        assert_eq!([corners(&faces[..13]), corners(&faces[13..])], [vec![0, 2, 1], vec![1, 2, 3]]);
    }
}
