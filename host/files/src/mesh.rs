//! The surface as a mesh: binary PLY, as MeshLab, CloudCompare and Blender read it.
//!
//! The aperture stands in the front focal plane, so the chief ray of an object point at distance z from the lens goes
//! through the front focus: a pixel of pitch p sees p (z - F) / F of the object, wherever the sensor stands. x to the
//! right, y up, z towards the viewer; all in mm, the optical axis in the image's middle.

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
}

/// The mesh of `depth_mm`, coloured by `grey` (any scale).
pub fn ply(depth_mm: ArrayView2<f32>, grey: ArrayView2<f32>, projection: Projection) -> Vec<u8> {
    let (height, width) = depth_mm.dim();
    let finite = || depth_mm.iter().copied().filter(|value| value.is_finite());
    let (low, high) = finite().fold((f32::MAX, f32::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let step = (high - low) * STEP;
    let brightest = grey.iter().copied().filter(|value| value.is_finite()).fold(1e-9, f32::max);

    const NONE: u32 = u32::MAX;
    let mut index = vec![NONE; width * height];
    let mut vertices = Vec::new();
    let mut count = 0u32;
    for ((row, column), &z) in depth_mm.indexed_iter() {
        if !z.is_finite() {
            continue;
        }
        index[row * width + column] = count;
        count += 1;
        let scale = projection.pixel_um * 1e-3 * (f64::from(z) / projection.focal_length_mm - 1.0);
        let x = (column as f64 - 0.5 * (width - 1) as f64) * scale;
        let y = (0.5 * (height - 1) as f64 - row as f64) * scale;
        for value in [x as f32, y as f32, -z] {
            vertices.extend(value.to_le_bytes());
        }
        let shade = (255.0 * (grey[[row, column]] / brightest).clamp(0.0, 1.0)).round() as u8;
        vertices.extend([shade; 3]);
    }

    let mut faces = Vec::new();
    let mut face_count = 0u32;
    for row in 0..height.saturating_sub(1) {
        for column in 0..width.saturating_sub(1) {
            let at = |down: usize, right: usize| (row + down, column + right);
            for corners in [[at(0, 0), at(1, 0), at(0, 1)], [at(0, 1), at(1, 0), at(1, 1)]] {
                let vertex = corners.map(|(row, column)| index[row * width + column]);
                let z = corners.map(|corner| depth_mm[corner]);
                let spread =
                    z.iter().fold(f32::MIN, |a, b| a.max(*b)) - z.iter().fold(f32::MAX, |a, b| a.min(*b));
                if vertex.contains(&NONE) || spread > step {
                    continue;
                }
                faces.push(3u8);
                for number in vertex {
                    faces.extend(number.to_le_bytes());
                }
                face_count += 1;
            }
        }
    }

    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment depth map in mm\nelement vertex {count}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {face_count}\nproperty list uchar uint vertex_indices\nend_header\n"
    )
    .into_bytes();
    bytes.extend(vertices);
    bytes.extend(faces);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn holes_have_no_vertices_and_steps_no_faces() {
        let depth = array![[900.0f32, 900.1, f32::NAN], [900.2, 900.1, 890.0]];
        let projection = Projection { focal_length_mm: 50.0, pixel_um: 7.4 };
        let bytes = ply(depth.view(), depth.view(), projection);
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains("element vertex 5\n"), "{text}");
        assert!(text.contains("element face 2\n"), "{text}");
        let header = text.find("end_header\n").unwrap() + "end_header\n".len();
        assert_eq!(bytes.len(), header + 5 * 15 + 2 * 13);
    }
}
