//! # farnear-rig
//!
//! What the board does, without its hardware: `no_std`, no allocator, time as an argument, so that all of it is
//! tested on the host. [`Rig`] is the whole; [`io`] is its seam to a board binary, which calls
//! [`Rig::tick`] 5000 times a second and moves bytes through [`Rig::receive`] and [`Rig::transmit`].
//!
//! ```text
//! rig        requests, the work that is under way, status       identity, settings: who and with what numbers
//! |- session    bytes <-> requests and answers; acts once
//! |- events     numbered; kept for whoever saw a gap
//! |- program    up to 64 shots: move, settle, trigger, strobe
//! |  '- camera     when it may be triggered
//! |- home       finds the home switch, fast and then exactly
//! '- stage      both axes; a way to a position (settle: on target for a dwell time)
//!    |- axis       feeds the step timer, counts, watches encoder, switches and driver
//!    |  '- ramp, steps    trapezoid segments; nanometres <-> pulses
//!    '- piezo      input shaping, observer, state feedback on the strain gauge
//!       '- shaper, gains, matrix    gains from physical numbers, worked out by the compiler
//! ```
//!
//! Goals: nothing from the link or the inputs can make it panic or leave the limits; a position is never believed
//! that steps and encoder do not agree on; every piece of long work ends with exactly one terminal event. Not a
//! goal: speed of the link; images do not come this way.
//!
//! Cost, counted on the emulated board at one instruction per cycle: a tick takes 140 instructions at rest and at
//! most 1,750 with the piezo's loop closed, of the 33,600 between two ticks at 168 MHz; the last byte of a request
//! 10,300 (CRC, encoding and remembering the answer). RAM: 7.4 KiB, no allocator, no floating point.
#![no_std]

#[cfg(test)]
extern crate std;

mod alarms;
mod calibrate;
mod camera;
mod correction;
pub mod events;
pub mod gains;
pub mod identity;
pub mod io;
mod matrix;
mod memory;
mod motion;
mod piezo;
pub mod program;
mod progress;
mod report;
mod requests;
mod rig;
pub mod session;
pub mod settings;
mod shaper;
mod silence;
mod sky;
mod work;

pub use identity::{Identity, LastWords};
pub use rig::Rig;
