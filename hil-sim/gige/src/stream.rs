//! Frames as stream packets (GVSP 1.x): leader, payload, trailer.

use crate::description::CHUNKS;

/// IP, UDP and GVSP headers, included in the packet size.
pub const HEADERS_BYTES: usize = 20 + 8 + 8;
pub const UDP_HEADERS_BYTES: usize = 20 + 8;

const LEADER: u32 = 1;
const TRAILER: u32 = 2;
const PAYLOAD: u32 = 3;
const IMAGE: u16 = 1;
const WITH_CHUNKS: u16 = 0x4000;
const IMAGE_CHUNK: u32 = 0xFA00_0000;
/// Chunk id and length.
const CHUNK_TRAILER_BYTES: u32 = 8;
const CHUNK_VALUE_BYTES: u32 = 8;

#[derive(Clone, PartialEq, Debug)]
pub struct Frame {
    /// From 1 at the start of the acquisition.
    pub number: u64,
    pub time_ns: u64,
    /// Code of the Pixel Format Naming Convention.
    pub pixel_format: u32,
    pub size_px: (u32, u32),
    pub offset_px: (u32, u32),
    pub pixels: Vec<u8>,
    /// Enabled chunks, if any.
    pub chunks: Option<[bool; CHUNKS.len()]>,
}

impl Frame {
    /// 16-bit frame id; skips 0 on overflow.
    pub fn short_number(&self) -> u16 {
        ((self.number - 1) % 65_535 + 1) as u16
    }

    /// Packets of at most this size with all headers.
    pub fn packets(&self, packet_bytes: usize) -> Vec<Vec<u8>> {
        let room = packet_bytes.saturating_sub(HEADERS_BYTES).max(1);
        let payload = self.payload();
        let mut packets = vec![self.packet(LEADER, 0, &self.leader())];
        let mut number = 1;
        for part in payload.chunks(room) {
            packets.push(self.packet(PAYLOAD, number, part));
            number += 1;
        }
        let trailer = [u32::from(self.payload_type()).to_be_bytes(), self.size_px.1.to_be_bytes()].concat();
        packets.push(self.packet(TRAILER, number, &trailer));
        packets
    }

    fn packet(&self, kind: u32, number: u32, content: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0, 0]; // status: success
        bytes.extend(self.short_number().to_be_bytes());
        bytes.extend((kind << 24 | number & 0x00ff_ffff).to_be_bytes());
        bytes.extend(content);
        bytes
    }

    fn payload_type(&self) -> u16 {
        IMAGE | if self.chunks.is_some() { WITH_CHUNKS } else { 0 }
    }

    fn leader(&self) -> Vec<u8> {
        let mut bytes = vec![0, 0];
        bytes.extend(self.payload_type().to_be_bytes());
        bytes.extend(self.time_ns.to_be_bytes());
        let (width, height) = self.size_px;
        for word in [self.pixel_format, width, height, self.offset_px.0, self.offset_px.1, 0] {
            bytes.extend(word.to_be_bytes());
        }
        bytes
    }

    fn payload(&self) -> Vec<u8> {
        let mut bytes = self.pixels.clone();
        let Some(on) = self.chunks else { return bytes };
        let close = |bytes: &mut Vec<u8>, id: u32, length: u32| {
            bytes.extend(id.to_be_bytes());
            bytes.extend(length.to_be_bytes());
        };
        close(&mut bytes, IMAGE_CHUNK, self.pixels.len() as u32);
        for ((value, (_, id)), on) in [self.time_ns, self.number].into_iter().zip(CHUNKS).zip(on) {
            if on {
                bytes.extend(value.to_be_bytes());
                close(&mut bytes, id, CHUNK_VALUE_BYTES);
            }
        }
        bytes
    }
}

/// Bytes after the pixels.
pub fn chunk_bytes(active: bool, on: [bool; CHUNKS.len()]) -> u32 {
    let values = on.iter().filter(|on| **on).count() as u32;
    if active { CHUNK_TRAILER_BYTES + values * (CHUNK_VALUE_BYTES + CHUNK_TRAILER_BYTES) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u64, chunks: Option<[bool; 2]>) -> Frame {
        Frame {
            number,
            time_ns: 0x0102_0304_0506_0708,
            pixel_format: 0x0108_0001,
            size_px: (5, 2),
            offset_px: (3, 4),
            pixels: (0..10).collect(),
            chunks,
        }
    }

    #[test]
    fn a_frame_is_a_leader_its_payload_and_a_trailer() {
        let packets = frame(65_536, None).packets(HEADERS_BYTES + 4);
        assert_eq!(packets.len(), 1 + 3 + 1);
        assert_eq!(packets[0][..8], [0, 0, 0, 1, 1, 0, 0, 0], "the short number goes around past 0");
        assert_eq!(packets[0][8..20], [0, 0, 0, 1, 1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(packets[0].len(), 8 + 36);
        let payload: Vec<u8> = packets[1..4].iter().flat_map(|packet| packet[8..].to_vec()).collect();
        assert_eq!(payload, (0..10).collect::<Vec<u8>>());
        assert_eq!(packets[4][4..8], [2, 0, 0, 4]);
    }

    #[test]
    fn chunks_follow_the_image() {
        let with = frame(9, Some([false, true]));
        let payload = with.payload();
        assert_eq!(payload.len() as u32, 10 + chunk_bytes(true, [false, true]));
        assert_eq!(payload[18..26], 9_u64.to_be_bytes());
        assert_eq!(payload[26..30], 0xFA00_0002_u32.to_be_bytes());
        assert_eq!(payload[30..34], 8_u32.to_be_bytes());
    }
}
