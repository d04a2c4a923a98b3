//! Surface mesh as binary PLY for MeshLab, CloudCompare and Blender. The aperture is in the front focal plane, so the
//! chief ray of an object point at distance z from the lens passes through the front focus: a pixel of pitch p sees p
//! (z - F) / F of the object at any sensor position. x to the right, y up, z towards the viewer, in the depths' unit.

use std::io::{self, Write};

use ndarray::{Array2, ArrayView2, ArrayViewMut1, Axis};
use rayon::prelude::*;

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

/// Rows that are encoded together, on all threads.
const ROWS: usize = 64;

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

    let mut marks = Array2::<u8>::zeros((height, width));
    let of_rows = marks.axis_iter_mut(Axis(0)).into_par_iter().enumerate().map(|(row, mut marks)| {
        if row > 0 {
            mark_faces(depth, row, step, &mut marks);
        }
        let vertices: u32 = depth.row(row).iter().map(|z| u32::from(z.is_finite())).sum();
        let faces: u32 = marks.iter().map(|mark| u32::from(mark & 1) + u32::from(mark >> 1)).sum();
        [vertices, faces]
    });
    let counts: Vec<[u32; 2]> = of_rows.collect();
    let [vertices, faces] = [0, 1].map(|of| counts.iter().map(|count| count[of] as usize).sum::<usize>());
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\ncomment depth map in {unit}\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )?;
    in_order(height, to, |row| {
        let mut bytes = vec![0; VERTEX_BYTES * (width + 1)];
        let mut end = 0;
        for (column, (&z, grey)) in depth.row(row).into_iter().zip(grey.row(row)).enumerate() {
            let [x, y] = lateral.beside_axis((height, width), column, row, f64::from(z));
            let shade = (255.0 * (grey / brightest).clamp(0.0, 1.0) + 0.5) as u8;
            let places = [x as f32, y as f32, -z].map(f32::to_le_bytes);
            bytes[end..end + 12].copy_from_slice(places.as_flattened());
            bytes[end + 12..end + VERTEX_BYTES].fill(shade);
            // Without a depth the next vertex takes its place.
            end += if z.is_finite() { VERTEX_BYTES } else { 0 };
        }
        bytes.truncate(end);
        bytes
    })?;
    // Vertices are numbered in order: the first of each row.
    let mut first = vec![0_u32];
    first.extend(counts.iter().scan(0, |next, [vertices, _]| {
        *next += vertices;
        Some(*next)
    }));
    in_order(height, to, |row| {
        let mut bytes = vec![3; FACE_BYTES * (2 * width + 2)];
        let mut end = 0;
        let mut face = |corners: [u32; 3], counts: u8| {
            bytes[end + 1..end + FACE_BYTES].copy_from_slice(corners.map(u32::to_le_bytes).as_flattened());
            end += usize::from(counts) * FACE_BYTES;
            bytes[end] = 3;
        };
        if row > 0 {
            let [mut upper, mut lower] = [first[row - 1], first[row]];
            let lines = depth.row(row - 1).into_iter().zip(depth.row(row)).zip(marks.row(row));
            for ((above, below), mark) in lines {
                let upper_right = upper + u32::from(above.is_finite());
                let lower_right = lower + u32::from(below.is_finite());
                face([upper, lower, upper_right], mark & 1);
                face([upper_right, lower, lower_right], mark >> 1);
                (upper, lower) = (upper_right, lower_right);
            }
        }
        bytes.truncate(end);
        bytes
    })
}

/// Encodes rows on all threads and writes them in order.
fn in_order(
    rows: usize,
    to: &mut impl Write,
    encode: impl Fn(usize) -> Vec<u8> + Sync + Send,
) -> io::Result<()> {
    for begin in (0..rows).step_by(ROWS) {
        let parts: Vec<Vec<u8>> = (begin..(begin + ROWS).min(rows)).into_par_iter().map(&encode).collect();
        to.write_all(&parts.concat())?;
    }
    Ok(())
}

const VERTEX_BYTES: usize = 15;
const FACE_BYTES: usize = 13;

/// [`write()`] into memory, for thinned maps.
pub fn ply(depth: ArrayView2<f32>, grey: ArrayView2<f32>, lateral: Lateral, unit: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(depth, grey, lateral, unit, &mut bytes).unwrap_or_else(|_| unreachable!("memory takes all bytes"));
    bytes
}

/// Triangles between the previous row and this one, right of each column: 1 = upper, lower, upper right; 2 = upper
/// right, lower, lower right; 3 = both.
fn mark_faces(depth_mm: ArrayView2<f32>, row: usize, step: f32, marks: &mut ArrayViewMut1<u8>) {
    let (upper, lower) = (depth_mm.row(row - 1), depth_mm.row(row));
    let joined = |a: f32, b: f32, c: f32| {
        // NaN propagates through the sum; these comparisons are one instruction each.
        let max = |a: f32, b: f32| if a > b { a } else { b };
        let min = |a: f32, b: f32| if a < b { a } else { b };
        let spread = max(max(a, b), c) - min(min(a, b), c);
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
