//! # farnear-workflows
//!
//! What a user can do with farnear, once, for every face: the command line, a web page, a batch runner, Python. A workflow
//! takes its settings as a struct and a [`Context`] (progress, questions, cancelling), reads and writes files, drives the
//! rig, and gives figures or a [`WorkflowError`] with the offending values. It never writes to a terminal, reads a
//! keyboard or listens for a signal.
//!
//! - [`rig`]: connecting, and all that a rig does; [`simulator`]: starting the emulated one.
//! - [`optics`], [`operators`], [`correction_file`]: what depth is computed with; [`operator_plot`]: operators as a picture.
//! - [`context`], [`error`]: the way to the face and back.

pub mod clock;
pub mod context;
pub mod correction_file;
pub mod error;
pub mod figures;
mod operator_cache;
pub mod operator_plot;
pub mod operators;
pub mod optics;
pub mod rig;
pub mod simulator;

pub use context::{Cancel, Context, Nobody, Progress, Questions};
pub use error::{Result, WorkflowError};

/// What records say made them.
pub const MADE_BY: &str = concat!("farnear ", env!("CARGO_PKG_VERSION"));
