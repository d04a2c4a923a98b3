//! A picture on the socket: length of a JSON header (u32, little-endian), header, pixels.

use axum::body::Bytes;
use farnear_files::video::Pixels;
use farnear_workflows::activity::streaming::Moment;
use ndarray::{Array2, Axis, s};
use serde::Serialize;
use serde_json::json;

/// Pixels begin at a multiple of this, so that the page needs no copy; spaces pad the header.
const ALIGNED: usize = 4;
/// Codes for depth; 0 means no value.
const CODES: f32 = 65_534.0;

/// Empty if the header has no JSON form; plain values always have one.
pub fn message(header: &impl Serialize, pixels: &[&[u8]]) -> Bytes {
    let mut header = serde_json::to_vec(header).unwrap_or_default();
    header.resize(header.len().next_multiple_of(ALIGNED), b' ');
    let length = (header.len() as u32).to_le_bytes();
    let mut message =
        Vec::with_capacity(4 + header.len() + pixels.iter().map(|part| part.len()).sum::<usize>());
    for part in [&length[..], &header].iter().chain(pixels) {
        message.extend_from_slice(part);
    }
    message.into()
}

/// Largest width of a picture of a person, px: for viewing only.
const PERSON_WIDTH: usize = 320;

/// Grey values, then the mask (1 = person); the answer is in the header.
pub fn person(moment: &Moment<'_>) -> Bytes {
    let step = moment.mask.ncols().div_ceil(PERSON_WIDTH).max(1);
    let mask = moment.mask.slice(s![..;step, ..;step]);
    let picture = match moment.picture {
        Pixels::Grey(grey) => grey.slice(s![..;step, ..;step]).to_owned(),
        Pixels::Rgb(rgb) => rgb.slice(s![..;step, ..;step, ..]).map_axis(Axis(2), |pixel| {
            let sum: u16 = pixel.iter().map(|level| u16::from(*level)).sum();
            ((sum + 1) / 3) as u8
        }),
    };
    let (height, width) = mask.dim();
    let header = json!({ "type": "person", "width": width, "height": height, "answer": moment.answer });
    let pixels: Vec<u8> =
        picture.iter().copied().chain(mask.iter().map(|person| u8::from(*person))).collect();
    message(&header, &[&pixels])
}

/// 16-bit codes, little-endian; 0 = no value. The resolution over 50 mm is below 0.001 mm.
pub fn depth_codes(depth_mm: &Array2<f32>, [low, high]: [f32; 2]) -> Vec<u8> {
    let scale = CODES / (high - low).max(f32::MIN_POSITIVE);
    let mut bytes = vec![0; 2 * depth_mm.len()];
    // Slices, because iterators of arrays are not vectorised.
    let depth_mm = depth_mm.as_standard_layout();
    for (pair, depth) in bytes.chunks_exact_mut(2).zip(depth_mm.as_slice().unwrap_or_default()) {
        pair.copy_from_slice(&code(*depth, low, scale).to_le_bytes());
    }
    bytes
}

fn code(depth: f32, low: f32, scale: f32) -> u16 {
    if depth.is_finite() { (((depth - low) * scale).clamp(0.0, CODES) + 0.5) as u16 + 1 } else { 0 }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn a_message_begins_with_the_length_of_its_header() {
        let bytes = message(&serde_json::json!({"width": 2}), &[&[7], &[8]]);
        assert_eq!(&bytes[..4], &12u32.to_le_bytes());
        assert_eq!(&bytes[4..16], b"{\"width\":2} ");
        assert_eq!(&bytes[16..], &[7, 8]);
    }

    #[test]
    fn depths_span_the_codes_and_none_is_zero() {
        let bytes =
            depth_codes(&array![[900.0, 950.0, 1000.0, f32::NAN, 2000.0, f32::INFINITY]], [900.0, 1000.0]);
        let codes: Vec<u16> = bytes.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        assert_eq!(codes, [1, 32768, 65535, 0, 65535, 0]);
    }
}
