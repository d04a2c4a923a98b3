//! The image within a frame's payload.

use aravis::Buffer;

/// Id and length behind each chunk.
const CHUNK_TRAILER_BYTES: usize = 8;
/// A camera may fill up a chunk to whole words, and its last packet.
const CHUNK_FILLING_BYTES: usize = 8;
const PACKET_FILLING_BYTES: usize = 9_000;

/// All bytes that came. Aravis' safe functions give those of an image or of a chunk whose id is known.
#[allow(unsafe_code)]
pub(super) fn received(buffer: &Buffer) -> Vec<u8> {
    let (data, length) = buffer.data();
    if data.is_null() {
        return Vec::new();
    }
    // SAFETY: the buffer owns at least this many bytes, and Aravis writes to them only while the stream has the buffer.
    unsafe { std::slice::from_raw_parts(data, length) }.to_vec()
}

/// Whether more came than the image that the leader announces, and the filling of its last packet.
pub(super) fn exceeds(came: usize, due: usize) -> bool {
    came.saturating_sub(due) > PACKET_FILLING_BYTES
}

/// The chunk with an image of `due` bytes; `None` unless the payload consists of chunks, one of them such an image. The
/// lengths are big-endian by GigE Vision, little-endian by USB3 Vision.
pub(super) fn image_chunk(payload: &[u8], due: usize) -> Option<&[u8]> {
    let orders: [fn([u8; 4]) -> u32; 2] = [u32::from_be_bytes, u32::from_le_bytes];
    orders.into_iter().find_map(|length| chunk_of(payload, due, length))
}

fn chunk_of(mut payload: &[u8], due: usize, length: fn([u8; 4]) -> u32) -> Option<&[u8]> {
    let mut image = None;
    while let Some((chunks, &[.., a, b, c, d])) = payload.split_last_chunk::<CHUNK_TRAILER_BYTES>() {
        let length = length([a, b, c, d]) as usize;
        let (before, chunk) = chunks.split_at(chunks.len().checked_sub(length)?);
        if length >= due && length - due < CHUNK_FILLING_BYTES {
            image = Some(chunk);
        }
        payload = before;
    }
    image.filter(|_| payload.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_is_the_chunk_of_its_length() {
        let image: Vec<u8> = (0..12).collect();
        for bytes_of in [u32::to_be_bytes, u32::to_le_bytes] {
            let part = |content: &[u8]| [content, &[0xfa, 0, 0, 1], &bytes_of(content.len() as u32)].concat();
            let payload = [part(&image), part(&[9; 24]), part(&[7; 8])].concat();
            // Ten bytes are filled up to three words.
            assert_eq!([12, 10].map(|due| image_chunk(&payload, due)), [Some(&image[..]); 2]);
            assert_eq!(image_chunk(&payload, 13), None);
            assert_eq!(image_chunk(&payload[1..], 12), None, "it does not consist of chunks");
            assert_eq!(image_chunk(&payload[..payload.len() - 3], 12), None);
        }
        assert_eq!(image_chunk(&[], 0), None);
    }

    #[test]
    fn a_full_last_packet_is_accepted() {
        assert!(!exceeds(320 * 240 + 8_900, 320 * 240) && !exceeds(10, 20));
        assert!(exceeds(640 * 480, 320 * 240), "a leader of a quarter of the image");
    }
}
