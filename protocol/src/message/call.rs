//! Body of a request frame: request and session.

use serde::{Deserialize, Serialize};

use super::Request;

/// [`Call::session`] of [`Request::Hello`].
pub const NO_SESSION: u32 = 0;
/// Largest step of a new request id, so that a damaged or stray frame cannot exhaust the ids.
pub const ID_STEP_MAX: u32 = 65_536;

/// A request with its session.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// Number of [`Request::OpenSession`], or [`NO_SESSION`]. Always four bytes, little-endian, for equal durations.
    #[serde(with = "postcard::fixint::le")]
    pub session: u32,
    /// What the board is to do or to answer.
    pub request: Request,
}
