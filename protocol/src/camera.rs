//! The simulator's camera endpoint: a loopback TCP stream beside the serial link.
//!
//! Each image from the simulator is
//! ```text
//! length u32 | shot_id u32 | exposure_us u64 | width u16 | height u16 | bits u8 | pixels u16 * width * height
//! ```
//! little-endian; `length` counts the bytes after itself. In the other direction the client may send
//! [`Control`] messages: `length u32 | postcard body`.

use serde::{Deserialize, Serialize};

use crate::units::{BoardMicros, Micros};

/// Bytes of [`FrameHeader`] on the wire.
pub const FRAME_HEADER: usize = 17;

/// What stands before the pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameHeader {
    /// Running number of the trigger since the board's reset: [`crate::message::ShotRecord::trigger_number`]; what
    /// [`Control::Expose`] said; or [`FREE_RUNNING`], whose images are told apart by the start of their exposures.
    pub shot_id: u32,
    /// Start of the exposure, board time.
    pub exposure: BoardMicros,
    /// Pixels per row.
    pub width: u16,
    /// Rows.
    pub height: u16,
    /// Bits per pixel that carry the picture, 8 to 16; pixels lie in 0..2^bits.
    pub bits: u8,
}

impl FrameHeader {
    /// The header as bytes.
    pub fn to_bytes(&self) -> [u8; FRAME_HEADER] {
        let mut bytes = [0; FRAME_HEADER];
        bytes[0..4].copy_from_slice(&self.shot_id.to_le_bytes());
        bytes[4..12].copy_from_slice(&self.exposure.0.to_le_bytes());
        bytes[12..14].copy_from_slice(&self.width.to_le_bytes());
        bytes[14..16].copy_from_slice(&self.height.to_le_bytes());
        bytes[16] = self.bits;
        bytes
    }

    /// The header from bytes; `None` for bits outside 8 to 16 or an empty picture.
    pub fn from_bytes(bytes: &[u8; FRAME_HEADER]) -> Option<Self> {
        let [s0, s1, s2, s3, t0, t1, t2, t3, t4, t5, t6, t7, w0, w1, h0, h1, bits] = *bytes;
        let header = Self {
            shot_id: u32::from_le_bytes([s0, s1, s2, s3]),
            exposure: BoardMicros(u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7])),
            width: u16::from_le_bytes([w0, w1]),
            height: u16::from_le_bytes([h0, h1]),
            bits,
        };
        ((8..=16).contains(&bits) && header.width > 0 && header.height > 0).then_some(header)
    }

    /// Value of the length field: header and pixels.
    pub fn length(&self) -> u32 {
        FRAME_HEADER as u32 + 2 * u32::from(self.width) * u32::from(self.height)
    }
}

/// What a client may ask of the simulator itself (never of a real rig).
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Control {
    /// Let this much virtual time pass, though nothing is under way (lockstep stands still otherwise).
    AdvanceMicros(u64),
    /// Software trigger: expose once, now.
    Expose {
        /// What the image will be called: [`FrameHeader::shot_id`].
        shot_id: u32,
        /// For so long.
        exposure: Micros,
    },
    /// Expose again and again, heedless of the trigger line, until another of these comes.
    FreeRun {
        /// From the start of one exposure to that of the next; at least exposure and read-out. 0: stop, and heed the
        /// trigger line again.
        period: Micros,
        /// How long each lasts.
        exposure: Micros,
    },
}

/// Stands where the length of an image would: another client has the camera, and this connection is closed.
pub const IN_USE: u32 = u32::MAX;

/// [`FrameHeader::shot_id`] of an image of a camera that runs freely.
pub const FREE_RUNNING: u32 = u32::MAX;
