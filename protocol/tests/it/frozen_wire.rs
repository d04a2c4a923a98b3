//! The bytes of protocol version 3: every message and every variant. Do not change an expectation: different bytes are
//! another protocol. Either the change is a mistake, or `PROTOCOL_CURRENT` grows and a new folder freezes the new
//! version. Messages may be appended. The first frame was also assembled by hand from `docs/protocol.md` (see
//! `by_hand`), with an independent CRC (Python's `zlib.crc32`).

pub mod answers;
mod events;
mod largest;
pub mod parts;
pub mod requests;

use farnear_protocol::{
    BoardMicros, Log, Micros, Nanometres, Request,
    camera::{Control, FREE_RUNNING, FrameHeader},
    frame::{Header, Kind, encode},
    message::*,
};
use serde::{Serialize, de::DeserializeOwned};

fn wire<T: Serialize>(kind: Kind, id: u32, message: &T) -> String {
    let header = Header { version: 3, kind, id, boot: 0x0102_0304 };
    encode(header, message).expect("fits").iter().map(|byte| format!("{byte:02x}")).collect()
}

const SESSION: u32 = 0x0506_0708;

fn check(found: &[String], frozen: &[&str]) {
    for (index, (found, frozen)) in found.iter().zip(frozen).enumerate() {
        assert_eq!(found, frozen, "message {index}");
    }
    assert_eq!(found.len(), frozen.len(), "freeze these:\n\"{}\",", found.join("\",\n\""));
}

/// Checks that `table` has every variant of an enum in order: the first byte is the variant's index (neighbours may
/// repeat a variant), and the next index does not decode.
#[track_caller]
fn lists_every_variant<T: Serialize + DeserializeOwned>(table: &[T]) {
    let mut buffer = [0; 512];
    let mut next = 0;
    for value in table {
        let place = postcard::to_slice(value, &mut buffer).expect("it fits")[0];
        assert!(place == next || place + 1 == next, "variant {place} is at the position of {next}");
        next = next.max(place + 1);
    }
    let mut beyond = [0; 512];
    beyond[0] = next;
    assert!(postcard::take_from_bytes::<T>(&beyond).is_err(), "variant {next} is missing in the table");
}

#[test]
fn by_hand() {
    // version 3, kind 1, id 5, boot 0x01020304, body 08 07 06 05 (session 0x05060708) 03 00 02 c0 84 3d (Move,
    // SensorCoarse, zigzag varint of 1, varint of 1,000,000), CRC-32/ISO-HDLC of these = 0x43e3a354 (zlib.crc32),
    // little-endian; then COBS and the delimiter.
    let request =
        Request::Move { axis: Axis::SensorCoarse, target: Nanometres(1), silence: Micros(1_000_000) };
    assert_eq!(wire(Kind::Request, 5, &Call { session: SESSION, request }), BY_HAND);
}

/// A move, see [`by_hand`].
pub const BY_HAND: &str = "0403010501010a0403020108070605030902c0843d54a3e34300";

#[test]
fn the_schema_key_changes_only_with_the_table() {
    assert_eq!(format!("{SCHEMA_KEY:016x}"), "783177dfbfb5477b");
}

#[test]
fn log() {
    let bytes = [0x00, 0x07, 0xff, 0x00].as_slice().try_into().expect("it fits");
    check(
        &[wire(Kind::Log, 3, &Log { bytes }), wire(Kind::Log, 4, &Log::default())],
        &["0403050301010604030201040307ff0569b28c1300", "040305040101050403020105a4a10ab400"],
    );
}

#[test]
fn camera_endpoint() {
    let header =
        FrameHeader { shot_id: 2, exposure: BoardMicros(2_000_020), width: 640, height: 480, bits: 8 };
    assert_eq!(header.length(), 17 + 2 * 640 * 480);
    let largest = FrameHeader { width: u16::MAX, height: u16::MAX, ..header };
    assert_eq!(largest.length(), u32::MAX, "it exceeds the field");
    assert_eq!(header.to_bytes(), [2, 0, 0, 0, 0x94, 0x84, 0x1e, 0, 0, 0, 0, 0, 0x80, 2, 0xe0, 1, 8]);
    assert_eq!(FrameHeader::from_bytes(&header.to_bytes()), Some(header));
    let mut buffer = [0; 16];
    let control = postcard::to_slice(&Control::AdvanceMicros(300), &mut buffer).expect("fits");
    assert_eq!(control, [0, 0xac, 2]);
    let (shot_id, exposure, period) = (7, Micros(5_000), Micros(20_000));
    let expose = postcard::to_slice(&Control::Expose { shot_id, exposure }, &mut buffer).expect("fits");
    assert_eq!(expose, [1, 7, 0x88, 0x27]);
    let free_run = postcard::to_slice(&Control::FreeRun { period, exposure }, &mut buffer).expect("fits");
    assert_eq!(free_run, [2, 0xa0, 0x9c, 1, 0x88, 0x27]);
    assert_eq!(FREE_RUNNING, u32::MAX);
}

#[test]
fn a_camera_frame_has_pixels_of_8_to_16_bits() {
    let header = FrameHeader { shot_id: 2, exposure: BoardMicros(5), width: 1, height: 1, bits: 8 };
    for (header, good) in [
        (header, true),
        (FrameHeader { bits: 16, ..header }, true),
        (FrameHeader { bits: 7, ..header }, false),
        (FrameHeader { bits: 17, ..header }, false),
        (FrameHeader { width: 0, ..header }, false),
        (FrameHeader { height: 0, ..header }, false),
    ] {
        assert_eq!(FrameHeader::from_bytes(&header.to_bytes()), good.then_some(header));
    }
}
