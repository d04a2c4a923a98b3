#![doc = include_str!("../README.md")]
//!
//! # Modules
//!
//! - [`message`]: requests, responses, events and errors, with units.
//! - [`frame`]: COBS(version, kind, id, boot, postcard body, CRC-32), at most [`frame::FRAME_MAX`] bytes, and a decoder
//!   that resynchronises after any garbage.
//! - [`settle`]: when a position counts as reached.
//! - [`camera`]: the length-prefixed frames of the simulator's camera endpoint (TCP, not the serial link).
#![no_std]
#![deny(missing_docs)]

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
