//! Identity of the board, known to the binary at start.

use farnear_protocol::message::ResetCause;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Board name, at most 24 bytes (truncated), e.g. `nucleo-f429zi`.
    pub board: &'static str,
    /// At most 24 bytes (truncated).
    pub firmware: &'static str,
    pub unique_id: [u8; 12],
    /// Boot number by retained RAM, not 0: one more than the last [`crate::Rig::boot`], or 1 after a power loss. A
    /// valid memory overrides it.
    pub boot: u32,
    /// Code retained by the piezo's DAC over the reset, if known.
    pub piezo_code: Option<u16>,
    pub reset_cause: ResetCause,
    /// The external clock is missing or stopped in the last boot; the internal one is used.
    pub own_clock: bool,
    /// Emulated board, by the strap.
    pub emulated: bool,
    /// Cause in retained RAM of a self-stop; given once.
    pub last_words: Option<LastWords>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LastWords {
    Panic,
    /// The stack reached its guard.
    StackOverflow,
}
