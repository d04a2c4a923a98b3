//! The body of a request's frame: a request, and the session it belongs to.

use serde::{Deserialize, Serialize};

use super::Request;

/// [`Call::session`] of [`Request::Hello`], which belongs to none.
pub const NO_SESSION: u32 = 0;
/// A new request's id lies at most this far above the last one. So no frame that went wrong on the way, or was never meant for
/// this board, can use all ids up.
pub const ID_STEP_MAX: u32 = 65_536;

/// A request and its session.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// The number that [`Request::OpenSession`] came with, or [`NO_SESSION`]. Four bytes, little-endian, whatever its
    /// value: a frame's length, and so its time on the wire, does not depend on it.
    #[serde(with = "postcard::fixint::le")]
    pub session: u32,
    /// The request.
    pub request: Request,
}
