//! Tasks of farnear, shared by all interfaces: command line, web page, batch runner, Python.
//!
//! A workflow takes a request and a [`Context`] (progress, questions, cancellation). It returns figures
//! or a [`WorkflowError`] with the offending values. It does not use the terminal, the keyboard or signals.
//!
//! Example: an interface that collects messages, and a stage move with a scripted board on the port.
//! ```
//! # #[cfg(target_os = "linux")] { // where a pseudo-terminal holds the board
//! # use std::sync::Mutex;
//! # use farnear_scripted_board::{Faults, plug_in};
//! use farnear_workflows::{Cancel, Context, Unattended, Progress, request::Request, rig};
//! #[derive(Default)]
//! struct Face(Mutex<Vec<String>>);
//!
//! impl Progress for Face {
//!     fn info(&self, what: &str) {
//!         self.0.lock().expect("one thread").push(what.into());
//!     }
//! }
//! let (port, _board) = plug_in(Faults::default());
//! let request = rig::motion::MoveRequest {
//!     rig: rig::RigAddress::Port(port),
//!     axis: vec![rig::AxisName::Lens],
//!     to_um: vec![1_000.0],
//!     home: true,
//! };
//! let face = Face::default();
//! // A clone of `cancel` can stop the rig from any thread.
//! let cancel = Cancel::default();
//! let context = Context::new(&face, &Unattended, cancel.clone());
//! let moved = request.run(&context)?;
//! assert!(matches!(moved, rig::motion::MoveFigures::One(lens) if lens.measured_um == 1_000.125));
//! assert!(face.0.lock().expect("one thread").iter().any(|said| said.starts_with("homing the lens stage")));
//! cancel.cancel();
//! let error = request.run(&context).expect_err("nothing moves any more");
//! assert!(error.is_cancelled());
//! # }
//! # Ok::<(), farnear_workflows::WorkflowError>(())
//! ```

pub mod activity;
pub mod batch;
pub mod cache;
pub mod calibrate;
pub mod camera;
pub mod camera_frames;
pub mod clock;
pub mod compare;
pub mod context;
pub mod correct;
pub mod correction_file;
mod counter;
pub mod depth;
pub mod doctor;
pub mod error;
pub mod figures;
pub mod focus_stack;
pub mod inputs;
pub mod lens_table;
pub mod measure;
pub mod operator_cache;
pub mod operator_plot;
pub mod operators;
pub mod optics;
mod parameters;
pub mod picture;
pub mod plot;
pub mod psf;
mod quantile;
pub mod report;
pub mod request;
pub mod result_folder;
pub mod rig;
pub mod sessions;
pub mod shadow;
pub mod silhouettes;
pub mod simulator;
pub mod sun;
pub mod target;
pub mod text_file;

pub use context::{Cancel, Context, Progress, Questions, Unattended};
pub use error::{Result, WorkflowError};

/// Program name and version, for records.
pub const MADE_BY: &str = concat!("farnear ", env!("CARGO_PKG_VERSION"));
