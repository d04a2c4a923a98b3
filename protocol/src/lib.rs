//! # farnear-protocol
//!
//! What host and board say to each other. Three layers, one file each:
//!
//! - [`message`]: the message table - every request, response, event and error, with units.
//! - [`frame`]: bytes on the wire - COBS(version, kind, id, boot, postcard body, CRC-32), at most
//!   [`frame::FRAME_MAX`] bytes, and a decoder that resynchronises after any garbage.
//! - [`camera`]: the length-prefixed frames of the simulator's camera endpoint (TCP, not the serial link).
//!
//! Goals: no request acts twice, nothing is believed without a CRC, a stranger can write a client from
//! `docs/protocol.md`. Not a goal: high throughput; images do not travel over this link.
#![no_std]

pub mod camera;
pub mod frame;
mod log;
pub mod message;
pub mod units;

pub use log::{LOG_BYTES_MAX, Log};
pub use message::{Event, EventKind, Request, RequestError, Response};
pub use units::{BoardMicros, Micros, Nanometres};

/// The oldest protocol version this crate can still speak.
pub const PROTOCOL_MIN: u8 = 2;
/// The protocol version this crate speaks.
pub const PROTOCOL_CURRENT: u8 = 2;
