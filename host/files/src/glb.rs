//! Surface mesh as binary glTF 2.0 (GLB) for browsers, Blender, game engines and augmented reality.
//!
//! Positions are in metres as glTF requires; x to the right, y up, z towards the viewer. The colour of each vertex is the grey value of
//! its pixel, shown without light (`KHR_materials_unlit`).

use std::io::{self, Write};

use ndarray::ArrayView2;

use crate::mesh::{Lateral, Projection, Surface};

/// Bytes per vertex (position, colour) and per face.
const VERTEX_BYTES: usize = 16;
const FACE_BYTES: usize = 12;
const MM: f32 = 1e-3;

/// The mesh of `depth_mm`, coloured by `grey` (any scale). A map without faces gives a scene without a mesh.
///
/// # Errors
/// More than 4 GB, and errors of the system.
pub fn write(
    depth_mm: ArrayView2<f32>,
    grey: ArrayView2<f32>,
    projection: Projection,
    to: &mut impl Write,
) -> io::Result<()> {
    let surface = Surface::new(depth_mm, grey, Lateral::Lens(projection));
    let (vertices, faces) = surface.count();
    if faces == 0 {
        return header(to, r#"{"asset":{"version":"2.0"}}"#, 0);
    }
    let mut corners = [[f32::MAX; 3], [f32::MIN; 3]];
    for (position, _) in (0..depth_mm.nrows()).flat_map(|row| surface.vertices(row)) {
        for axis in 0..3 {
            corners[0][axis] = corners[0][axis].min(MM * position[axis]);
            corners[1][axis] = corners[1][axis].max(MM * position[axis]);
        }
    }
    let [min, max] = corners;
    let (points, total) = (VERTEX_BYTES * vertices, VERTEX_BYTES * vertices + FACE_BYTES * faces);
    let indices = 3 * faces;
    let json = format!(
        r#"{{"asset":{{"version":"2.0","generator":"farnear"}},"extensionsUsed":["KHR_materials_unlit"],
"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"depth"}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":1}},"indices":2,"material":0}}]}}],
"materials":[{{"doubleSided":true,"extensions":{{"KHR_materials_unlit":{{}}}}}}],
"accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":{vertices},"min":{min:?},"max":{max:?}}},
{{"bufferView":0,"byteOffset":12,"componentType":5121,"normalized":true,"type":"VEC4","count":{vertices}}},
{{"bufferView":1,"componentType":5125,"type":"SCALAR","count":{indices}}}],
"bufferViews":[{{"buffer":0,"byteLength":{points},"byteStride":{VERTEX_BYTES},"target":34962}},
{{"buffer":0,"byteOffset":{points},"byteLength":{},"target":34963}}],
"buffers":[{{"byteLength":{total}}}]}}"#,
        total - points
    );
    header(to, &json, total)?;
    surface.write_vertices(to, |bytes, position, shade| {
        position.iter().for_each(|value| bytes.extend_from_slice(&(MM * value).to_le_bytes()));
        bytes.extend_from_slice(&[shade, shade, shade, u8::MAX]);
    })?;
    surface.write_faces(to, |bytes, corners| {
        corners.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    })
}

/// File header, JSON chunk padded to 4 bytes, and the header of a binary chunk of `binary` bytes unless that is 0.
fn header(to: &mut impl Write, json: &str, binary: usize) -> io::Result<()> {
    let json = format!("{json:0$}", json.len().next_multiple_of(4));
    let chunk = if binary == 0 { 0 } else { 8 + binary };
    let size = |bytes: usize| {
        u32::try_from(bytes).map_err(|_| io::Error::other("the mesh is larger than the 4 GB of a GLB file"))
    };
    to.write_all(b"glTF")?;
    for number in [2, size(20 + json.len() + chunk)?, size(json.len())?] {
        to.write_all(&number.to_le_bytes())?;
    }
    to.write_all(b"JSON")?;
    to.write_all(json.as_bytes())?;
    if binary > 0 {
        to.write_all(&size(binary)?.to_le_bytes())?;
        to.write_all(b"BIN\0")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    const LENS: Projection = Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };

    /// The JSON chunk and the binary chunk, by the lengths in the headers.
    fn chunks(glb: &[u8]) -> (String, &[u8]) {
        let number = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!(
            (&glb[..4], number(4), number(8), &glb[16..20]),
            (&b"glTF"[..], 2, glb.len(), &b"JSON"[..])
        );
        let end = 20 + number(12);
        let json = String::from_utf8(glb[20..end].to_vec()).unwrap();
        if end == glb.len() {
            return (json, &[]);
        }
        assert_eq!((end % 4, number(end), &glb[end + 4..end + 8]), (0, glb.len() - end - 8, &b"BIN\0"[..]));
        (json, &glb[end + 8..])
    }

    #[test]
    fn positions_are_in_metres_and_faces_look_at_the_viewer() {
        let depth = array![[900.0f32, 900.1, f32::NAN], [900.2, 900.1, 890.0]];
        let mut glb = Vec::new();
        write(depth.view(), depth.view(), LENS, &mut glb).unwrap();
        let (json, binary) = chunks(&glb);
        assert!(json.contains(r#""count":5,"min":"#) && json.contains(r#""count":6}"#), "{json}");
        assert_eq!(binary.len(), 5 * VERTEX_BYTES + 2 * FACE_BYTES);
        let float = |at: usize| f32::from_le_bytes(binary[at..at + 4].try_into().unwrap());
        // The first pixel is a column left of the axis and half a row above it; a pixel of pitch p sees p (z - F) / F.
        let pixel_m = 7.4e-6 * 850.0 / 50.0;
        for (axis, expected) in [-pixel_m, 0.5 * pixel_m, -0.9].into_iter().enumerate() {
            assert!((float(4 * axis) - expected).abs() < 1e-6, "{axis}: {}", float(4 * axis));
        }
        let corners: Vec<u32> = binary[5 * VERTEX_BYTES..]
            .chunks(4)
            .map(|number| u32::from_le_bytes(number.try_into().unwrap()))
            .collect();
        assert_eq!(corners, [0, 2, 1, 1, 2, 3]);
    }

    #[test]
    fn a_map_without_depth_is_a_valid_file() {
        let depth = ndarray::Array2::from_elem((3, 3), f32::NAN);
        let mut glb = Vec::new();
        write(depth.view(), depth.view(), LENS, &mut glb).unwrap();
        let (json, binary) = chunks(&glb);
        assert!(json.starts_with(r#"{"asset""#) && binary.is_empty(), "{json}");
    }
}
