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
    /// What retained RAM says is the number of this boot, not 0: one more than [`crate::Rig::boot`] of the boot before, or
    /// 1 after a loss of power. The memory knows better, where it is good.
    pub boot: u32,
    /// Code that the piezo's DAC has kept over the reset; `None` where it is not known.
    pub piezo_code: Option<u16>,
    /// Why the board was reset.
    pub reset_cause: ResetCause,
    /// Whether the clock from outside did not come, or stopped in the boot before, so that the chip runs on its own.
    pub own_clock: bool,
    /// Whether the strap says that this is an emulated board.
    pub emulated: bool,
    /// What the firmware wrote into retained RAM before it stopped itself; given once.
    pub last_words: Option<LastWords>,
}

/// Why the firmware stopped itself in the boot before this.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LastWords {
    /// A panic or a hard fault.
    Panic,
    /// The stack grew into its guard.
    StackOverflow,
}
