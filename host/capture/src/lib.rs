//! # farnear-capture
//!
//! Talks to the rig and takes pictures with it; blocking, no async runtime.
//!
//! - [`transport`], [`client`], [`work`], [`log_stream`]: the serial port, handles of the board behind it, long work with
//!   its end, and the board's log.
//! - [`camera`]: where images come from.
//! - [`ready`], [`plan`], [`pair`], [`record`]: homing, where the axes go for a pair, taking it, and the folder it is kept in.
//! - [`half_mirror`]: a pair of one exposure, by two cameras.
//! - [`expose`], [`focus`], [`sequence`]: programs with a camera: finding the focus, focus stacks, programs from a file.
//! - [`continuous`]: a cycle of shots without an end, for live depth: a stream of exposures with their images.
//! - [`board_correction`]: depth correction by the board's own mathematics.
//! - [`timing`]: how long the host waits, and why.
//! - [`error`], [`describe`]: what can go wrong, in words.
//!
//! A handle of a board behind a serial port comes from [`Client::open`]; here a scripted board stands at the other end of
//! the line.
//!
//! ```
//! use farnear_capture::{Client, ClientError};
//! use farnear_protocol::{Nanometres, message::Axis};
//! use farnear_scripted_board::{Faults, Peer};
//!
//! let board = Peer::new(Faults::default());
//! let rig = Client::connect(board.connect(), "scripted")?;
//!
//! // Nothing but the piezo moves before homing, and the refusal says why.
//! let refused = rig.move_to(Axis::SensorCoarse, Nanometres(5_800_000));
//! assert!(matches!(refused, Err(ClientError::Refused { .. })));
//!
//! rig.home(Axis::SensorCoarse)?;
//! let moved = rig.move_to(Axis::SensorCoarse, Nanometres(5_800_000))?;
//! // The encoder says where the screw has come to; the piezo makes up for the rest.
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
