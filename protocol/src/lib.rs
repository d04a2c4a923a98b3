//! # farnear-protocol
//!
//! What host and board say to each other:
//!
//! - [`message`]: the message table - every request, response, event and error, with units.
//! - [`frame`]: bytes on the wire - COBS(version, kind, id, boot, postcard body, CRC-32), at most
//!   [`frame::FRAME_MAX`] bytes, and a decoder that resynchronises after any garbage.
//! - [`settle`]: when a position counts as reached, unless somebody asks for something else.
//! - [`camera`]: the length-prefixed frames of the simulator's camera endpoint (TCP, not the serial link).
//!
//! A request becomes a frame, and the frame a request again:
//!
//! ```
//! use farnear_protocol::frame::{Decoder, Header, Kind, encode};
//! use farnear_protocol::message::Axis;
//! use farnear_protocol::{Call, Micros, Nanometres, PROTOCOL_CURRENT, Request};
//!
//! // To far focus, 20 um; if the host is silent for a second the board stops.
//! let request = Request::Move {
//!     axis: Axis::SensorFine,
//!     target: Nanometres(20_000),
//!     silence: Micros(1_000_000),
//! };
//! let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: 7, boot: 1 };
//! let call = Call { session: 0x1234_5678, request };
//! let wire = encode(header, &call).expect("every message fits a frame");
//! assert_eq!(wire.last(), Some(&0), "0 ends a frame and is nowhere else in it");
//!
//! // The other end takes byte after byte; whatever stood on the line before is skipped.
//! let mut decoder = Decoder::new();
//! let noise = b"garbage\0";
//! let mut packets = noise.iter().chain(&wire).filter_map(|byte| decoder.push(*byte)?.ok());
//! let packet = packets.next().expect("the frame is whole and its CRC right");
//! assert_eq!(packet.header, header);
//! assert_eq!(packet.message(), Some(call));
//! ```
//!
//! Goals: no request acts twice, nothing is believed without a CRC, a stranger can write a client from
//! `docs/protocol.md`. Not a goal: high throughput; images do not travel over this link.
#![no_std]

pub mod camera;
pub mod frame;
mod log;
pub mod message;
pub mod settle;
pub mod units;

pub use log::{LOG_BYTES_MAX, Log};
pub use message::{Call, Event, EventKind, Request, RequestError, Response};
pub use settle::Settle;
pub use units::{BoardMicros, Micros, Nanometres};

/// The oldest protocol version this crate can still speak.
pub const PROTOCOL_MIN: u8 = 3;
/// The protocol version this crate speaks.
pub const PROTOCOL_CURRENT: u8 = 3;
