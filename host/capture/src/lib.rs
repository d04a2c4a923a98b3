//! Controls the rig and takes pictures with it; blocking, no async runtime.
//! - [`transport`], [`client`], [`work`], [`log_stream`]: serial port, board handles, long work, and the board's log.
//! - [`camera`]: image sources.
//! - [`ready`], [`plan`], [`pair`], [`record`]: homing, positions of a pair, its capture, and its folder.
//! - [`half_mirror`]: a pair of one exposure, by two cameras.
//! - [`expose`], [`focus`], [`sequence`]: programs with a camera: focus search, focus stacks, program files.
//! - [`continuous`]: endless cycles of shots for live depth.
//! - [`board_correction`]: depth correction by the board's mathematics.
//! - [`timing`], [`error`], [`describe`]: timeouts and their reasons, errors in words.
//!
//! [`Client::open`] opens a serial port; this example uses a scripted board.
//! ```
//! use farnear_capture::{Client, ClientError};
//! use farnear_protocol::{Nanometres, message::Axis};
//! use farnear_scripted_board::{Faults, Peer};
//! let board = Peer::new(Faults::default());
//! let rig = Client::connect(board.connect(), "scripted")?;
//! // Only the piezo moves before homing.
//! let refused = rig.move_to(Axis::SensorCoarse, Nanometres(5_800_000));
//! assert!(matches!(refused, Err(ClientError::Refused { .. })));
//! rig.home(Axis::SensorCoarse)?;
//! let moved = rig.move_to(Axis::SensorCoarse, Nanometres(5_800_000))?;
//! // Position by encoder; the piezo compensates for the difference.
//! assert_eq!(moved.measured, Nanometres(5_800_375));
//! # Ok::<(), ClientError>(())
//! ```

pub mod average;
pub mod board_correction;
pub mod camera;
pub mod client;
pub mod continuous;
pub mod describe;
pub mod error;
mod events;
pub mod expose;
pub mod find;
pub mod focus;
pub mod half_mirror;
mod handshake;
mod link;
mod link_rate;
pub mod log_stream;
mod meter;
mod owner;
pub mod pair;
pub mod plan;
pub mod ready;
pub mod record;
mod requests;
pub mod sequence;
pub mod timing;
pub mod transport;
pub mod work;

pub use client::Client;
pub use error::{ClientError, PortError};
pub use log_stream::{LogPart, LogStream};
pub use owner::Connect;
pub use timing::Timing;
pub use transport::{SerialTransport, Transport};
pub use work::{Step, Work};
