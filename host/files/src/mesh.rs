//! Surface mesh as binary PLY for MeshLab, CloudCompare and Blender. The aperture is in the front focal plane, so the
//! chief ray of an object point at distance z from the lens passes through the front focus: a pixel of pitch p sees p
//! (z - F) / F of the object at any sensor position. x to the right, y up, z towards the viewer, in the depths' unit.

use std::io::{self, Write};

use ndarray::ArrayView2;

/// Depth step between surfaces, part of the map's range.
const STEP: f32 = 0.1;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Projection {
    pub focal_length_mm: f64,
    pub pixel_um: f64,
    /// Column and row of the optical axis; `None`: centre.
    pub axis_px: Option<[f64; 2]>,
}

impl Projection {
    pub fn axis_in(&self, (height, width): (usize, usize)) -> [f64; 2] {
        self.axis_px.unwrap_or([width, height].map(|n| 0.5 * (n as f64 - 1.0)))
    }

    /// Position of a pixel's object at depth `z` relative to the optical axis: right and up, mm.
    pub fn beside_axis_mm(&self, dim: (usize, usize), column: usize, row: usize, z: f64) -> [f64; 2] {
        let axis = self.axis_in(dim);
        let scale = self.pixel_um * 1e-3 * (z / self.focal_length_mm - 1.0);
        [(column as f64 - axis[0]) * scale, (axis[1] - row as f64) * scale]
    }
}

/// Positions of pixels' object points relative to the optical axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Lateral {
    /// Along rays through the lens' front focus; depths are in mm.
    Lens(Projection),
    /// Side of a pixel at the object, in the unit of the depths.
    Pixel(f64),
    /// Positions are in pixels.
    Unknown,
}

impl Lateral {
    /// Position of a pixel's object at depth `z`, right and up, in the unit of the depths, or in pixels if unknown.
    pub fn beside_axis(&self, dim: (usize, usize), column: usize, row: usize, z: f64) -> [f64; 2] {
        let even = |side: f64| {
            let (height, width) = dim;
            let [x, y] = [width, height].map(|n| 0.5 * (n as f64 - 1.0));
            [(column as f64 - x) * side, (y - row as f64) * side]
        };
        match self {
            Self::Lens(projection) => projection.beside_axis_mm(dim, column, row, z),
            Self::Pixel(side) => even(*side),
            Self::Unknown => even(1.0),
        }
    }

    /// The same for a map of every `step`-th row and column.
    #[must_use]
    pub fn thinned(self, step: usize) -> Self {
        let step = step as f64;
        match self {
            Self::Lens(lens) => Self::Lens(Projection {
                pixel_um: lens.pixel_um * step,
                axis_px: lens.axis_px.map(|axis| axis.map(|place| place / step)),
                ..lens
            }),
            Self::Pixel(side) => Self::Pixel(side * step),
            Self::Unknown => Self::Pixel(step),
        }
    }
}

/// No vertex.
const NONE: u32 = u32::MAX;

/// Writes the mesh of `depth`, coloured by `grey` (any scale), row by row, as large maps exceed memory. Names the unit.
pub fn write(
    depth: ArrayView2<f32>,
    grey: ArrayView2<f32>,
    lateral: Lateral,
    unit: &str,
    to: &mut impl Write,
) -> io::Result<()> {
    let (height, width) = depth.dim();
    let finite = || depth.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite().fold((f32::MAX, f32::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let step = (high - low) * STEP;
    let brightest = grey.iter().copied().filter(|value| value.is_finite()).fold(1e-9, f32::max);

    let mut marks = vec![0; width];
    let (mut vertices, mut faces) = (0, 0);
    for row in 0..height {
        vertices += depth.row(row).iter().map(|z| u32::from(z.is_finite())).sum::<u32>() as usize;
        if row > 0 {
            mark_faces(depth, row, step, &mut marks);
            faces +=
                marks.iter().map(|mark| u32::from(mark & 1) + u32::from(mark >> 1)).sum::<u32>() as usize;
        }
    }
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\ncomment depth map in {unit}\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )?;
    // Whole rows, for large writes.
    let mut bytes = Vec::with_capacity(2 * FACE_BYTES * width);
    for row in 0..height {
        bytes.clear();
        let line = depth.row(row).into_iter().zip(grey.row(row)).enumerate();
        for (column, (&z, grey)) in line.filter(|(_, (z, _))| z.is_finite()) {
            let [x, y] = lateral.beside_axis((height, width), column, row, f64::from(z));
            let shade = (255.0 * (grey / brightest).clamp(0.0, 1.0) + 0.5) as u8;
            let mut vertex = [shade; VERTEX_BYTES];
            for (place, value) in vertex.chunks_exact_mut(4).zip([x as f32, y as f32, -z]) {
                place.copy_from_slice(&value.to_le_bytes());
            }
            bytes.extend_from_slice(&vertex);
        }
        to.write_all(&bytes)?;
    }
    // Vertices are numbered in order, so two rows of numbers suffice.
    let mut next = 0;
    let mut numbers = [vec![NONE; width], vec![NONE; width]];
    for row in 0..height {
        numbers.swap(0, 1);
        for (number, z) in numbers[1].iter_mut().zip(depth.row(row)) {
            *number = if z.is_finite() { next } else { NONE };
            next += u32::from(z.is_finite());
        }
        if row == 0 {
            continue;
        }
        mark_faces(depth, row, step, &mut marks);
        bytes.clear();
        let [upper, lower] = &numbers;
        for ((mark, upper), lower) in marks.iter().zip(upper.windows(2)).zip(lower.windows(2)) {
            if mark & 1 != 0 {
                bytes.extend_from_slice(&face([upper[0], lower[0], upper[1]]));
            }
            if mark & 2 != 0 {
                bytes.extend_from_slice(&face([upper[1], lower[0], lower[1]]));
            }
        }
        to.write_all(&bytes)?;
    }
    Ok(())
}

const VERTEX_BYTES: usize = 15;
const FACE_BYTES: usize = 13;

fn face(corners: [u32; 3]) -> [u8; FACE_BYTES] {
    let mut face = [3_u8; FACE_BYTES];
    for (place, number) in face[1..].chunks_exact_mut(4).zip(corners) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    face
}

/// [`write()`] into memory, for thinned maps.
pub fn ply(depth: ArrayView2<f32>, grey: ArrayView2<f32>, lateral: Lateral, unit: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(depth, grey, lateral, unit, &mut bytes).unwrap_or_else(|_| unreachable!("memory takes all bytes"));
    bytes
}

/// Triangles between the previous row and this one, right of each column: 1 = upper, lower, upper right; 2 = upper
/// right, lower, lower right; 3 = both.
fn mark_faces(depth_mm: ArrayView2<f32>, row: usize, step: f32, marks: &mut [u8]) {
    let (upper, lower) = (depth_mm.row(row - 1), depth_mm.row(row));
    marks.fill(0);
    let joined = |a: f32, b: f32, c: f32| {
        // NaN propagates through the sum, but not through min and max.
        let spread = a.max(b).max(c) - a.min(b).min(c);
        u8::from((a + b + c).is_finite() & (spread <= step))
    };
    let corners = upper.iter().zip(upper.iter().skip(1)).zip(lower.iter().zip(lower.iter().skip(1)));
    for (mark, ((above, above_right), (below, below_right))) in marks.iter_mut().zip(corners) {
        *mark = joined(*above, *below, *above_right) | joined(*above_right, *below, *below_right) << 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn holes_have_no_vertices_and_steps_no_faces() {
        let depth = array![[900.0f32, 900.1, f32::NAN], [900.2, 900.1, 890.0]];
        let projection = Projection { focal_length_mm: 50.0, pixel_um: 7.4, axis_px: None };
        let bytes = ply(depth.view(), depth.view(), Lateral::Lens(projection), "mm");
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
