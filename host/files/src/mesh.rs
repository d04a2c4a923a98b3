//! Surface mesh as binary PLY for MeshLab, CloudCompare and Blender: x to the right, y up, z towards the viewer, in the
//! depths' unit.

use std::io::{self, Write};

use ndarray::{ArrayView2, CowArray, Ix2};
use rayon::prelude::*;

use crate::map;

/// Depth step between surfaces, part of the map's range.
const STEP: f32 = 0.1;

/// Chief rays through one point: a pixel of pitch p sees `p (z - centre) / distance` of the object at depth z.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Projection {
    /// Centre of projection before the lens: the front focus of a lens that is telecentric on the image side.
    pub centre_mm: f64,
    /// Principal distance: the focal length of such a lens.
    pub distance_mm: f64,
    pub pixel_um: f64,
    /// Column and row of the optical axis; `None`: centre.
    pub axis_px: Option<[f64; 2]>,
}

impl Projection {
    pub fn axis_in(&self, (height, width): (usize, usize)) -> [f64; 2] {
        self.axis_px.unwrap_or([width, height].map(|n| 0.5 * (n as f64 - 1.0)))
    }

    /// Position of a pixel's object at depth `z` relative to the optical axis: right and up, mm.
    #[inline]
    pub fn beside_axis_mm(&self, dim: (usize, usize), column: usize, row: usize, z: f64) -> [f64; 2] {
        let axis = self.axis_in(dim);
        let scale = self.pixel_um * 1e-3 * (z - self.centre_mm) / self.distance_mm;
        [(column as f64 - axis[0]) * scale, (axis[1] - row as f64) * scale]
    }
}

/// Positions of pixels' object points relative to the optical axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Lateral {
    /// Along the lens' chief rays; depths are in mm.
    Lens(Projection),
    /// Side of a pixel at the object, in the unit of the depths.
    Pixel(f64),
    /// Positions are in pixels.
    Unknown,
}

impl Lateral {
    /// Position of a pixel's object at depth `z`, right and up, in the unit of the depths, or in pixels if unknown.
    #[inline]
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

    /// The same for every `step`-th row and column of a map of (height, width).
    #[must_use]
    pub fn thinned(self, dim: (usize, usize), step: usize) -> Self {
        let step = step as f64;
        match self {
            Self::Lens(lens) => Self::Lens(Projection {
                pixel_um: lens.pixel_um * step,
                // The middle of the remaining pixels is elsewhere.
                axis_px: Some(lens.axis_in(dim).map(|place| place / step)),
                ..lens
            }),
            Self::Pixel(side) => Self::Pixel(side * step),
            Self::Unknown => Self::Pixel(step),
        }
    }
}

/// Rows that are encoded together, per thread: few, to be written from the cache.
const ROWS: usize = 8;

/// Surface through a depth map, coloured by an image of any scale. Written row by row, as large maps exceed memory.
pub(crate) struct Surface<'a> {
    /// By rows.
    depth: CowArray<'a, f32, Ix2>,
    grey: ArrayView2<'a, f32>,
    lateral: Lateral,
    /// Largest depth step within a triangle.
    step: f32,
    brightest: f32,
}

impl<'a> Surface<'a> {
    pub(crate) fn new(depth: ArrayView2<'a, f32>, grey: ArrayView2<'a, f32>, lateral: Lateral) -> Self {
        let [low, high] = map::range(depth).unwrap_or_default();
        let brightest = map::range(grey).map_or(0.0, |[_, high]| high).max(1e-9);
        let by_rows = depth.is_standard_layout();
        let depth = if by_rows { depth.into() } else { depth.as_standard_layout().into_owned().into() };
        Self { depth, grey, lateral, step: (high - low) * STEP, brightest }
    }

    /// Numbers of vertices and faces.
    pub(crate) fn count(&self) -> (usize, usize) {
        let rows = (0..self.depth.nrows()).into_par_iter();
        let counts = rows.map_init(
            || vec![0; self.depth.ncols()],
            |marks, row| {
                self.mark_faces(row, marks);
                let faces = marks.iter().map(|mark| u32::from(mark & 1) + u32::from(mark >> 1)).sum::<u32>();
                (self.vertices_of(row) as usize, faces as usize)
            },
        );
        counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
    }

    fn vertices_of(&self, row: usize) -> u32 {
        self.depth.row(row).iter().map(|z| u32::from(z.is_finite())).sum()
    }

    fn mark_faces(&self, row: usize, marks: &mut [u8]) {
        marks.fill(0);
        if row > 0 {
            let rows = [row - 1, row].map(|row| self.depth.row(row).to_slice().expect("made by rows"));
            mark_faces(rows, self.step, marks);
        }
    }

    /// Positions and shades of a row's vertices.
    pub(crate) fn vertices(&self, row: usize) -> impl Iterator<Item = ([f32; 3], u8)> {
        let line = self.depth.row(row).into_iter().zip(self.grey.row(row)).enumerate();
        line.filter(|(_, (z, _))| z.is_finite()).map(move |(column, (&z, grey))| {
            let [x, y] = self.lateral.beside_axis(self.depth.dim(), column, row, f64::from(z));
            let shade = (255.0 * (grey / self.brightest).clamp(0.0, 1.0) + 0.5) as u8;
            ([x as f32, y as f32, -z], shade)
        })
    }

    /// Writes what `vertex` appends for each vertex, row by row.
    pub(crate) fn write_vertices(
        &self,
        to: &mut impl Write,
        vertex: impl Fn(&mut Vec<u8>, [f32; 3], u8) + Sync,
    ) -> io::Result<()> {
        self.write_rows(to, |row, bytes| {
            self.vertices(row).for_each(|(position, shade)| vertex(bytes, position, shade));
        })
    }

    /// Writes what `face` appends for the corners of each face, anticlockwise for the viewer.
    pub(crate) fn write_faces(
        &self,
        to: &mut impl Write,
        face: impl Fn(&mut Vec<u8>, [u32; 3]) + Sync,
    ) -> io::Result<()> {
        let (height, width) = self.depth.dim();
        // Vertices are numbered in order; the first of each row.
        let mut next = 0;
        let first: Vec<u32> = (0..height)
            .map(|row| {
                let count = self.vertices_of(row);
                next += count;
                next - count
            })
            .collect();
        self.write_rows(to, |row, bytes| {
            let mut marks = vec![0; width];
            self.mark_faces(row, &mut marks);
            let above = row.saturating_sub(1);
            let [mut upper, mut lower] = [first[above], first[row]];
            let lines = self.depth.row(above).into_iter().zip(self.depth.row(row));
            for (mark, (above, below)) in marks.iter().zip(lines) {
                let upper_right = upper + u32::from(above.is_finite());
                let lower_right = lower + u32::from(below.is_finite());
                if mark & 1 != 0 {
                    face(bytes, [upper, lower, upper_right]);
                }
                if mark & 2 != 0 {
                    face(bytes, [upper_right, lower, lower_right]);
                }
                (upper, lower) = (upper_right, lower_right);
            }
        })
    }

    /// Encodes rows on all threads and writes them in order.
    fn write_rows(&self, to: &mut impl Write, encode: impl Fn(usize, &mut Vec<u8>) + Sync) -> io::Result<()> {
        let height = self.depth.nrows();
        let together = (ROWS * rayon::current_num_threads()).min(height.max(1));
        let mut rows = vec![Vec::new(); together];
        for begin in (0..height).step_by(together) {
            let part = &mut rows[..together.min(height - begin)];
            part.par_iter_mut().enumerate().for_each(|(i, bytes)| {
                bytes.clear();
                encode(begin + i, bytes);
            });
            part.iter().try_for_each(|bytes| to.write_all(bytes))?;
        }
        Ok(())
    }
}

/// Writes the mesh of `depth`, coloured by `grey` (any scale). Names the unit.
pub fn write(
    depth: ArrayView2<f32>,
    grey: ArrayView2<f32>,
    lateral: Lateral,
    unit: &str,
    to: &mut impl Write,
) -> io::Result<()> {
    let surface = Surface::new(depth, grey, lateral);
    let (vertices, faces) = surface.count();
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\ncomment depth map in {unit}\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
    )?;
    surface.write_vertices(to, |bytes, position, shade| {
        let mut vertex = [shade; 15];
        for (place, value) in vertex.chunks_exact_mut(4).zip(position) {
            place.copy_from_slice(&value.to_le_bytes());
        }
        bytes.extend_from_slice(&vertex);
    })?;
    surface.write_faces(to, |bytes, corners| {
        let mut face = [3_u8; 13];
        for (place, number) in face[1..].chunks_exact_mut(4).zip(corners) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        bytes.extend_from_slice(&face);
    })
}

/// [`write()`] into memory, for thinned maps.
pub fn ply(depth: ArrayView2<f32>, grey: ArrayView2<f32>, lateral: Lateral, unit: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(depth, grey, lateral, unit, &mut bytes).unwrap_or_else(|_| unreachable!("memory takes all bytes"));
    bytes
}

/// Triangles between two rows, right of each column but the last: 1 = upper, lower, upper right; 2 = upper right, lower,
/// lower right; 3 = both.
fn mark_faces([upper, lower]: [&[f32]; 2], step: f32, marks: &mut [u8]) {
    // NaN propagates through the sum; these comparisons are one instruction each.
    let joined = |a: f32, b: f32, c: f32| {
        let max = |a: f32, b: f32| if a > b { a } else { b };
        let min = |a: f32, b: f32| if a < b { a } else { b };
        let spread = max(max(a, b), c) - min(min(a, b), c);
        u8::from((a + b + c).is_finite() & (spread <= step))
    };
    let faces = upper.len().saturating_sub(1);
    let (above, below, marks) = (&upper[..faces], &lower[..faces], &mut marks[..faces]);
    let [above_right, below_right] = [upper, lower].map(|row| &row[row.len() - faces..]);
    for x in 0..faces {
        marks[x] = joined(above[x], below[x], above_right[x])
            | joined(above_right[x], below[x], below_right[x]) << 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn a_thinned_map_has_the_axis_of_the_whole_one() {
        let projection = Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };
        let (dim, step) = ((1537, 2050), 6);
        for axis_px in [None, Some([100.0, 7.5])] {
            let lateral = Lateral::Lens(Projection { axis_px, ..projection });
            let (whole, thinned) = (lateral, lateral.thinned(dim, step));
            let of_whole = whole.beside_axis(dim, 30 * step, 11 * step, 900.0);
            let of_thinned = thinned.beside_axis((257, 342), 30, 11, 900.0);
            for (a, b) in of_whole.into_iter().zip(of_thinned) {
                assert!((a - b).abs() < 1e-9, "{of_whole:?} {of_thinned:?}");
            }
        }
    }

    #[test]
    fn holes_have_no_vertices_and_steps_no_faces() {
        let depth = array![[900.0f32, 900.1, f32::NAN], [900.2, 900.1, 890.0]];
        let projection = Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };
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
