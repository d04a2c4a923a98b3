//! Identity of the board, known to the binary at start.

use farnear_protocol::message::ResetCause;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Board name, at most 24 bytes (truncated), e.g. `nucleo-f429zi`.
    pub board: &'static str,
    /// At most 24 bytes (truncated).
    pub firmware: &'static str,
    pub unique_id: [u8; 12],
    /// Boot number by retained RAM, from 1: one more than the last [`crate::Rig::boot`]. A valid memory overrides it.
    pub boot: u32,
    /// Code retained by the piezo's DAC over the reset, if known.
    pub piezo_code: Option<u16>,
    pub reset_cause: ResetCause,
    /// The external clock is missing or stopped in the last boot; the internal one is used.
    pub own_clock: bool,
    pub emulated: bool,
    /// Cause in retained RAM of a self-stop; given once.
    pub last_words: Option<LastWords>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LastWords {
    Panic,
    StackOverflow,
}
