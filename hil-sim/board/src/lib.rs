//! # farnear-sim
//!
//! The rig without hardware: the unmodified firmware ELF on an emulated STM32, and around it a plant with
//! two motorised stages, a piezo, encoders, end switches and a camera. What the firmware measures, it measures through the
//! registers it uses on the real board; what is really there is in [`plant`], and only tests may look.
//!
//! - [`rig`]: the emulated rig in this process, for tests.
//! - [`run`](mod@run): the program: a pty and a camera endpoint for any client.
//! - [`board`], [`chips`], [`memory`], [`serial`], [`wiring`]: the board as the emulator sees it, and its wires.
//! - [`camera`], [`eye`]: when the camera exposes, and what it sees.
//! - [`driver`], [`lockstep`]: when virtual time passes.
//! - [`mod@count`]: instructions of the on-board routines.
//! - [`hands`], [`faults`], [`trace`]: what can be done to a rig, what can be broken, and what can be watched.
//!
//! # Time
//! Virtual time is counted in nanoseconds and has nothing to do with the clock on the wall. In lockstep it
//! passes only while the board owes the host something, so the same requests give the same bytes on any
//! machine, as long as the host asks while time stands (a request sent during a move arrives when it arrives).

pub mod board;
pub mod camera;
pub mod chips;
pub mod count;
pub mod driver;
pub mod endpoint;
pub mod error;
pub mod eye;
pub mod faults;
pub mod firmware;
pub mod hands;
pub mod lockstep;
pub mod memory;
pub mod plant;
pub mod port;
pub mod rig;
pub mod run;
pub mod serial;
pub mod trace;
pub mod wiring;

pub use driver::{Pace, Report, StageReport};
pub use error::SimError;
pub use hands::Hands;
pub use rig::{EmulatedRig, RigConfig};
