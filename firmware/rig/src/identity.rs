//! Who this board is: what the binary knows at start and hello tells.

use farnear_protocol::message::ResetCause;

/// What the binary knows of itself and its chip when it starts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Name of the board, at most 24 bytes, e.g. `nucleo-f429zi`; what is beyond is cut off.
    pub board: &'static str,
    /// Firmware version, at most 24 bytes; what is beyond is cut off.
    pub firmware: &'static str,
    /// The chip's unique id.
    pub unique_id: [u8; 12],
    /// Number of this boot, not 0; differs from that of the boot before.
    pub boot: u32,
    /// Why the board was reset.
    pub reset_cause: ResetCause,
    /// Whether the strap says that this is an emulated board.
    pub emulated: bool,
}
