//! The board's log on the link: its defmt stream, decoded with the firmware's ELF.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Largest payload of a log frame, bytes.
pub const LOG_BYTES_MAX: usize = 200;

/// A part of the defmt stream. A gap in the frame numbers means lost bytes.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
pub struct Log {
    /// Bytes of the defmt encoder.
    pub bytes: Vec<u8, LOG_BYTES_MAX>,
}
