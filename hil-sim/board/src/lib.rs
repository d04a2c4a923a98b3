//! # farnear-sim
//!
//! The rig without hardware: the unmodified firmware ELF on an emulated STM32, and around it a plant with
//! two motorised stages, a piezo, encoders, end switches and a camera. What the firmware measures, it measures through the
//! registers it uses on the real board; what is really there is in [`plant`], and only tests may look.
//!
//! - [`parts`]: what the parts are like, the numbers of `parts.toml`; [`processor`]: what its instructions cost.
//! - [`rig`]: the emulated rig in this process, for tests; [`config`], [`command`], [`report`]: what it is made of, what
//!   it can be asked and what it answers.
//! - [`run`](mod@run): the program: a pty ([`port`]) and a camera [`endpoint`] for any client; the same camera as one of GigE Vision ([`farnear_gige`]).
//! - [`board`], [`chips`], [`memory`], [`memory_file`], [`serial`], [`wiring`]: the board as the emulator sees it, and its wires.
//! - [`camera`], [`imager`], [`half_mirror`]: when the camera exposes, its images, and a second camera.
//! - [`driver`]: what happens whenever the emulator stops; [`pacing`], [`lockstep`]: when virtual time passes.
//! - [`mod@count`]: instructions of the on-board routines.
//! - [`faults`]: what can be broken, from a file; [`access`]: the same from a test; [`trace`]: what can be watched.
//!
//! # Time
//! Virtual time is counted in nanoseconds and has nothing to do with the clock on the wall. In lockstep it
//! passes only while the board owes the host something, so the same requests give the same bytes on any
//! machine, as long as the host asks while time stands (a request sent during a move arrives when it arrives).

pub mod access;
mod adapter;
pub mod board;
pub mod camera;

pub mod chips;
pub mod command;
pub mod config;
pub mod count;
pub mod cpu_time;
pub mod driver;
pub mod endpoint;
pub mod error;
pub mod faults;
pub mod firmware;

pub mod half_mirror;
pub mod imager;

mod lights;
mod link_rates;
pub mod lockstep;
pub mod memory;
pub mod memory_file;
pub mod pacing;
pub mod parts;
pub mod pictures;
pub mod plant;

pub mod observer;
pub mod port;
pub mod processor;
pub mod replay;
pub mod report;
pub mod rig;
pub mod run;
pub mod scenario;
pub mod serial;
pub mod trace;
pub mod wiring;

pub use access::RigAccess;
pub use config::{Pace, RigConfig};
pub use error::SimError;
pub use parts::Parts;
pub use report::{Report, StageReport};
pub use rig::EmulatedRig;
pub use scenario::Scenario;
