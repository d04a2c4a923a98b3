//! # farnear-rig
//!
//! Behaviour of the board without its hardware: `no_std`, no allocator, time as an argument, so all of it is tested on
//! the host. [`Rig`] is the whole; [`io`] its interface to the hardware, [`control`] the loop that transfers inputs,
//! outputs and bytes 5000 times a second. A board implements only [`control::Board`].
//!
//! ```text
//! control    a board's loop: read, decide, apply, send, feed the watchdog     ring: laps of its receive buffer
//! rig        a tick: alarms, stored state                           identity, settings: who, with what numbers
//! |- session    bytes <-> requests and answers; acts once
//! |- requests   checks and start of each request                       report: hello and status
//! |- progress   continuation and end of long work                   work: active work per axis or for the whole rig
//! |- events     numbered; stored for repetition
//! |- link_rate  its change, and the fallback                        notes: entries of the log
//! |- alarms     latched, numbered, cleared one by one               silence: the host must stay in touch
//! |- memory     records in two copies: format, writing, contents
//! |- correction, sun_query    depth correction and the sun over the link (farnear-maths)
//! |- program    up to 64 shots: move, settle, expose, strobe
//! |  '- camera     readiness, trigger source, edges
//! |- calibrate  travel, backlash, piezo, gauge
//! '- motion     both stages
//!    |- stage      two steppers and the piezo, read and driven together
//!    |- home, leg, positioning, settling    homing, travel to a switch, moves, settle criterion
//!    |- axis       feeds a step timer, counts, checks encoder, switches and driver
//!    |  '- ramp, steps    jerk-limited segments; nanometres <-> pulses
//!    '- piezo      input shaping, observer, state feedback on the strain gauge, the calibrated model
//!       '- shaper, gains, matrix    gains from physical numbers at compile time      relax: the ramp down
//! ```
//!
//! Goals: no input can cause a panic or exceed the limits; a position is valid only while steps and encoder agree; long
//! work ends with exactly one terminal event; causes of a stop are named, latched and survive a power loss. Not a goal:
//! link speed.
//!
//! Cost in instructions, counted on the emulated board, of 33,600 per tick at 168 MHz: a tick 1,400 at rest, 2,600 with
//! the piezo's loop closed, 4,300 with it and both steppers at 40 kHz; the last byte of a move request 1,800, the
//! start 32,000. Mathematics may exceed a tick (a row of 640 pixels 15,000, a fit 742,000) and is rejected during
//! motion. RAM: 25 KiB, 12 of them scratch memory for depth correction. Stack: 10 KiB for a request, 19 KiB for the
//! start. Ramps and shadow use single precision, only the fit double.
#![no_std]

#[cfg(test)]
extern crate std;

mod alarms;
mod calibrate;
mod camera;
pub mod control;
mod correction;
pub mod events;
pub mod gains;
pub mod identity;
pub mod io;
mod light;
mod link_rate;
mod matrix;
mod memory;
mod motion;
pub mod notes;
mod piezo;
pub mod program;
mod progress;
pub mod relax;
mod report;
mod requests;
mod rig;
pub mod ring;
pub mod session;
pub mod settings;
mod shaper;
mod silence;
pub mod stamp;
pub mod sun_query;
mod work;

pub use identity::{Identity, LastWords};
pub use rig::Rig;
