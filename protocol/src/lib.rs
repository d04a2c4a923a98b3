#![doc = include_str!("../README.md")]
//! # Modules
//! - [`message`]: requests, responses, events and errors, with units.
//! - [`frame`]: framing with COBS and CRC-32, and a decoder that resynchronises after any garbage.
//! - [`settle`]: when a position counts as reached.
//! - [`camera`]: frames of the simulator's camera endpoint (TCP, not the serial link).
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

/// Oldest supported protocol version.
pub const PROTOCOL_MIN: u8 = 3;
/// Newest supported protocol version.
pub const PROTOCOL_CURRENT: u8 = 3;
