//! # farnear-workflows
//!
//! What a user can do with farnear, once, for every face: the command line, a web page, a batch runner, Python. A workflow
//! takes its settings as a struct and a [`Context`] (progress, questions, cancelling), reads and writes files, drives the
//! rig, and gives figures or a [`WorkflowError`] with the offending values. It never writes to a terminal, reads a
//! keyboard or listens for a signal.
//!
//! - [`rig`]: connecting, and all that a rig does; [`simulator`]: starting the emulated one.
//! - [`camera`]: cameras without a rig: which there are, what they can, pictures to keep and to look at.
//! - [`depth`]: from a pair to a folder with its map; [`correct`], [`compare`]: what is done with maps.
//! - [`optics`], [`operators`], [`correction_file`]: what depth is computed with; [`operator_plot`]: operators as a picture.
//! - [`measure`]: figures of a map: a region with its plane, a profile, a difference; [`picture`]: figures of an image;
//!   [`lens_table`]: the working range as it is typed; [`sessions`], [`report`]: captures that were kept, and a page about one.
//! - [`target`]: a flat target to print; [`calibrate`]: learning the point spread function and corrections.
//! - [`silhouettes`]: masks of a person from video, motion capture or made people; [`shadow`]: taking shadow off them, by where the
//!   [`sun`] stands; [`activity`]: what the person does.
//! - [`inputs`], [`result_folder`]: hashes of what a result was made from; folders that hold the result of one run.
//! - [`batch`]: a list of such jobs on all cores, to be gone on with after whatever stopped it.
//! - [`doctor`]: checks of this computer.
//! - [`context`], [`error`]: the way to the face and back.
//!
//! A face that keeps what it is told, and a stage that is moved; a scripted board stands behind the port here.
//!
//! ```
//! # #[cfg(target_os = "linux")] { // where a pseudo-terminal holds the board
//! # use std::sync::Mutex;
//! # use farnear_protocol::message::Axis;
//! # use farnear_scripted_board::{Faults, plug_in};
//! use farnear_workflows::{Cancel, Context, Unattended, Progress, rig};
//!
//! #[derive(Default)]
//! struct Face(Mutex<Vec<String>>);
//!
//! impl Progress for Face {
//!     fn info(&self, what: &str) {
//!         self.0.lock().expect("one thread").push(what.into());
//!     }
//! }
//!
//! let (port, _board) = plug_in(Faults::default());
//! let settings = rig::motion::MoveSettings {
//!     rig: rig::RigAddress::Port(port),
//!     targets: vec![(Axis::Lens, 1_000.0)],
//!     home: true,
//! };
//! let face = Face::default();
//! // A clone of `cancel` can stop the rig from any thread.
//! let cancel = Cancel::default();
//! let context = Context::new(&face, &Unattended, cancel.clone());
//! let moved = rig::motion::move_to(&settings, &context)?;
//! assert!(matches!(moved, rig::motion::MoveFigures::One(lens) if lens.measured_um == 1_000.125));
//! assert!(face.0.lock().expect("one thread").iter().any(|said| said.starts_with("homing the lens stage")));
//!
//! cancel.cancel();
//! let error = rig::motion::move_to(&settings, &context).expect_err("nothing moves any more");
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
pub mod psf;
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

/// What records say made them.
pub const MADE_BY: &str = concat!("farnear ", env!("CARGO_PKG_VERSION"));
