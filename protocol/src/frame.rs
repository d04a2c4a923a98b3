//! Frames: the bytes on the wire.
//! ```text
//! COBS( version u8 | kind u8 | id u32 | boot u32 | postcard body | CRC-32 ) 0x00
//! ```
//! Little-endian. The CRC is CRC-32/ISO-HDLC over all bytes before it. A frame has at most [`FRAME_MAX`] bytes with its
//! delimiter. Header and CRC are the same in every protocol version, so that a board can reject other versions. Cost:
//! one pass each for COBS and CRC; no allocation.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Largest frame on the wire in bytes, delimiter included.
pub const FRAME_MAX: usize = 256;
/// Bytes before the body.
pub const HEADER: usize = 10;
/// Bytes of the CRC after the body.
pub const CRC_BYTES: usize = 4;
/// Largest body: [`FRAME_MAX`] without header, CRC, delimiter and the byte of COBS overhead.
pub const BODY_MAX: usize = FRAME_MAX - HEADER - CRC_BYTES - 2;

const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// An encoded frame, ready for the wire.
pub type Encoded = Vec<u8, FRAME_MAX>;

/// An encoded frame with leading delimiter, see [`delimited`].
pub type Delimited = Vec<u8, { FRAME_MAX + 1 }>;

/// Type of a frame's body.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Kind {
    /// Host to board: [`crate::Call`]; id = request id.
    Request = 1,
    /// Board to host: [`crate::Response`]; id = request id.
    Response = 2,
    /// Board to host: [`crate::RequestError`]; id = request id.
    Error = 3,
    /// Board to host: [`crate::Event`]; id = event number.
    Event = 4,
    /// Board to host: [`crate::Log`]; id = running number of the log's frames.
    Log = 5,
}

impl Kind {
    fn from_byte(byte: u8) -> Option<Self> {
        [Self::Request, Self::Response, Self::Error, Self::Event, Self::Log]
            .into_iter()
            .find(|kind| *kind as u8 == byte)
    }
}

/// Fields before the body.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Header {
    pub version: u8,
    pub kind: Kind,
    /// Request id or event number.
    pub id: u32,
    /// Boot number of the board; 0 = unknown.
    pub boot: u32,
}

/// A frame with a correct CRC and an undecoded body.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Packet {
    pub header: Header,
    /// Undecoded postcard body.
    pub body: Vec<u8, BODY_MAX>,
}

impl Packet {
    /// Decodes the body; `None` if it is not exactly one `T`.
    pub fn message<'a, T: Deserialize<'a>>(&'a self) -> Option<T> {
        match postcard::take_from_bytes(&self.body) {
            Ok((message, [])) => Some(message),
            _ => None,
        }
    }
}

/// Why bytes between two delimiters are rejected.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameError {
    /// More than [`FRAME_MAX`] bytes without a delimiter.
    TooLong,
    /// Shorter than header and CRC.
    TooShort,
    /// Invalid COBS encoding.
    Encoding,
    Crc,
    /// Unknown value of [`Kind`].
    Kind,
}

/// Encodes a message; `None` if it exceeds a frame, as no message of [`crate::message`] does.
pub fn encode<T: Serialize>(header: Header, message: &T) -> Option<Encoded> {
    let mut raw = [0u8; HEADER + BODY_MAX + CRC_BYTES];
    raw[0] = header.version;
    raw[1] = header.kind as u8;
    raw[2..6].copy_from_slice(&header.id.to_le_bytes());
    raw[6..HEADER].copy_from_slice(&header.boot.to_le_bytes());
    let body = postcard::to_slice(message, &mut raw[HEADER..HEADER + BODY_MAX]).ok()?.len();
    let end = HEADER + body;
    let crc = CRC.checksum(&raw[..end]);
    raw[end..end + CRC_BYTES].copy_from_slice(&crc.to_le_bytes());

    let mut wire = Encoded::new();
    wire.resize(FRAME_MAX, 0).ok()?;
    let length = cobs::try_encode(&raw[..end + CRC_BYTES], &mut wire).ok()?;
    // The encoder may have changed the byte after the encoding.
    wire.truncate(length);
    wire.push(0).ok()?;
    Some(wire)
}

/// Adds a leading delimiter, so that a damaged frame costs only itself. Optional; both sides send it.
pub fn delimited(frame: &Encoded) -> Delimited {
    let mut bytes = Delimited::new();
    // There is room for the longest frame and one byte.
    let _ = bytes.push(0);
    let _ = bytes.extend_from_slice(frame);
    bytes
}

/// Decodes the bytes between two delimiters.
pub fn decode(between: &[u8]) -> Result<Packet, FrameError> {
    if between.len() >= FRAME_MAX {
        return Err(FrameError::TooLong);
    }
    let mut raw = [0u8; FRAME_MAX];
    let length = cobs::decode(between, &mut raw).map_err(|_| FrameError::Encoding)?;
    let raw = raw.get(..length).ok_or(FrameError::Encoding)?;
    let (content, crc) = raw.split_last_chunk::<CRC_BYTES>().ok_or(FrameError::TooShort)?;
    let (head, body) = content.split_first_chunk::<HEADER>().ok_or(FrameError::TooShort)?;
    if CRC.checksum(content) != u32::from_le_bytes(*crc) {
        return Err(FrameError::Crc);
    }
    let [version, kind, i0, i1, i2, i3, b0, b1, b2, b3] = *head;
    Ok(Packet {
        header: Header {
            version,
            kind: Kind::from_byte(kind).ok_or(FrameError::Kind)?,
            id: u32::from_le_bytes([i0, i1, i2, i3]),
            boot: u32::from_le_bytes([b0, b1, b2, b3]),
        },
        body: Vec::from_slice(body).map_err(|_| FrameError::TooLong)?,
    })
}

/// Cuts a byte stream into frames; resynchronises at the next delimiter.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    between: Vec<u8, FRAME_MAX>,
    overlong: bool,
}

impl Decoder {
    /// Accepts a stream from any position.
    pub const fn new() -> Self {
        Self { between: Vec::new(), overlong: false }
    }

    /// Accepts one byte; at a delimiter returns the frame before it or its error. Skips empty frames: they flush.
    pub fn push(&mut self, byte: u8) -> Option<Result<Packet, FrameError>> {
        if byte != 0 {
            self.overlong |= self.between.push(byte).is_err();
            return None;
        }
        let result = match (self.overlong, self.between.is_empty()) {
            (true, _) => Some(Err(FrameError::TooLong)),
            (false, true) => None,
            (false, false) => Some(decode(&self.between)),
        };
        self.between.clear();
        self.overlong = false;
        result
    }
}
