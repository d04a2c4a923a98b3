//! # farnear-rig
//!
//! What the board does, without its hardware: `no_std`, no allocator, time as an argument, so that all of it is
//! tested on the host. [`Rig`] is the whole; [`io`] is its seam to the hardware, [`control`] the loop that carries
//! inputs, outputs and bytes across it 5000 times a second. A board implements [`control::Board`] and nothing else.
//!
//! ```text
//! control    a board's loop: read, decide, carry out, speak, feed the watchdog
//! rig        a tick: what stops everything, what is remembered      identity, settings: who, and with what numbers
//! |- session    bytes <-> requests and answers; acts once
//! |- requests   what each is checked for and starts, no one left out    report: hello and status
//! |- progress   how long work goes on and ends                      work: what is under way, on each axis or on all
//! |- events     numbered; kept for whoever saw a gap
//! |- link_rate  its change, and the way back                       notes: what the log is told
//! |- alarms     latched, numbered, cleared one by one               silence: the host must stay in touch
//! |- memory     records in two copies: their form, the writing, what is in them
//! |- correction, sun_query    depth correction and the sun over the link (farnear-maths)
//! |- program    up to 64 shots: move, settle, expose, strobe
//! |  '- camera     when it may be exposed, by whom, and what it answers
//! |- calibrate  travel, backlash, the piezo's figures
//! '- motion     both stages
//!    |- stage      two steppers and the piezo, sensed and driven together
//!    |- home, leg, positioning, settling    the switch, a way to it, a position, on target for a dwell time
//!    |- axis       feeds a step timer, counts, watches encoder, switches and driver
//!    |  '- ramp, steps    jerk-limited segments; nanometres <-> pulses
//!    '- piezo      input shaping, observer, state feedback on the strain gauge, the calibrated model
//!       '- shaper, gains, matrix    gains from physical numbers, worked out by the compiler
//! ```
//!
//! Goals: nothing from the link or the inputs can make it panic or leave the limits; a position is never believed
//! that steps and encoder do not agree on; every piece of long work ends with exactly one terminal event; whatever
//! stops the rig is named, latched, and survives the loss of power. Not a goal: speed of the link; images do not
//! come this way.
//!
//! Cost, counted on the emulated board at one instruction per cycle: a tick takes 1,600 instructions at rest, 2,900
//! with the piezo's loop closed, and at most 7,100 with both steppers in their ramps besides, of the 33,600 between
//! two ticks at 168 MHz; the last byte of a move request 9,900, the start 46,000. Mathematics may take longer than
//! a tick (a row of 640 pixels 15,000, the solution of a fit 731,000), so it is refused while anything moves. RAM:
//! 25 KiB, 12 of them scratch memory for depth correction; no allocator. Stack: 10 KiB for a request, 19 KiB for
//! the start. Single precision in the ramps and the shadow, double only in the solution of a fit.
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
mod report;
mod requests;
mod rig;
pub mod session;
pub mod settings;
mod shaper;
mod silence;
pub mod stamp;
pub mod sun_query;
mod work;

pub use identity::{Identity, LastWords};
pub use rig::Rig;
