//! The board's log on the link: the bytes of its defmt stream, to be decoded with the firmware's ELF file.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Bytes in one message.
pub const LOG_BYTES_MAX: usize = 200;

/// Some bytes of the defmt stream. A gap in the frames' numbers means that bytes are missing.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
pub struct Log {
    /// The bytes, as the encoder gave them.
    pub bytes: Vec<u8, LOG_BYTES_MAX>,
}
