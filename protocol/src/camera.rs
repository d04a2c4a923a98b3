//! The simulator's camera endpoint: a loopback TCP stream next to the serial link. Each image is
//! ```text
//! length u32 | shot_id u32 | exposure_us u64 | width u16 | height u16 | bits u8 | pixels u16 * width * height
//! ```
//! little-endian; `length` counts the bytes after itself. Clients may send [`Control`]: `length u32 | postcard body`.

use serde::{Deserialize, Serialize};

use crate::units::{BoardMicros, Micros};

/// Bytes of [`FrameHeader`] on the wire.
pub const FRAME_HEADER: usize = 17;

/// Header of a frame's pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FrameHeader {
    /// Trigger number since the board's reset ([`crate::message::ShotRecord::trigger_number`]), the id of
    /// [`Control::Expose`], or [`FREE_RUNNING`] for all free-running images.
    pub shot_id: u32,
    /// Start of the exposure, board time.
    pub exposure: BoardMicros,
    pub width: u16,
    pub height: u16,
    /// Significant bits per pixel, 8 to 16.
    pub bits: u8,
}

impl FrameHeader {
    /// The header in the order of its fields, little-endian.
    pub fn to_bytes(&self) -> [u8; FRAME_HEADER] {
        let mut bytes = [0; FRAME_HEADER];
        bytes[0..4].copy_from_slice(&self.shot_id.to_le_bytes());
        bytes[4..12].copy_from_slice(&self.exposure.0.to_le_bytes());
        bytes[12..14].copy_from_slice(&self.width.to_le_bytes());
        bytes[14..16].copy_from_slice(&self.height.to_le_bytes());
        bytes[16] = self.bits;
        bytes
    }

    /// Parses the header; `None` for bits outside 8 to 16 or an empty picture.
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

    /// Length field: header and pixels, bytes. [`IN_USE`], never a valid length, for a picture that exceeds the field.
    pub fn length(&self) -> u32 {
        let pixels = u32::from(self.width) * u32::from(self.height);
        pixels.saturating_mul(2).saturating_add(FRAME_HEADER as u32)
    }
}

/// Requests to the simulator itself (never to a real rig).
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Control {
    /// Let this much virtual time pass; in lockstep an idle board stops time.
    AdvanceMicros(u64),
    /// Software trigger of one exposure.
    Expose {
        /// Image id, see [`FrameHeader::shot_id`].
        shot_id: u32,
        /// Exposure time of the image.
        exposure: Micros,
    },
    /// Free running, ignoring the trigger line, until the next such message.
    FreeRun {
        /// Exposure period, at least exposure and read-out; 0 stops free running.
        period: Micros,
        /// Exposure time of each image.
        exposure: Micros,
    },
}

/// Sent instead of an image length: another client has the camera; the connection closes.
pub const IN_USE: u32 = u32::MAX;

/// [`FrameHeader::shot_id`] of free-running images.
pub const FREE_RUNNING: u32 = u32::MAX;
