//! The rig without hardware: the unmodified firmware ELF on an emulated STM32 with motorised stages, piezo, encoders,
//! end switches and camera. The firmware measures through its registers; the true state is in [`plant`].
//!
//! - [`parts`]: properties of the parts (`parts.toml`); [`processor`]: instruction costs.
//! - [`rig`]: the rig in this process, for tests, with [`config`], [`command`] and [`report`].
//! - [`run`](mod@run): the program with its [`port`], a camera [`endpoint`] and a [`farnear_gige`] camera.
//! - [`board`], [`chips`], [`memory`], [`memory_file`], [`serial`], [`wiring`]: the emulated board.
//! - [`camera`], [`imager`], [`half_mirror`]: exposure timing, images, and the second camera.
//! - [`driver`]: the emulator's stops; [`pacing`], [`lockstep`]: when virtual time passes.
//! - [`mod@count`]: instruction counts of on-board routines.
//! - [`faults`]: faults from a file; [`access`]: faults from a test; [`trace`]: recordings.
//!
//! Virtual time, in nanoseconds, is independent of the wall clock; in lockstep it passes only while the board has
//! something outstanding. The same requests then give the same bytes on any machine, unless sent during a move.

pub mod access;
mod adapter;
pub mod board;
pub mod board_test;
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
mod stop_wire;
pub mod trace;
pub mod wiring;

pub use access::RigAccess;
pub use config::{Pace, RigConfig};
pub use error::SimError;
pub use parts::Parts;
pub use report::{Report, StageReport};
pub use rig::EmulatedRig;
pub use scenario::Scenario;
