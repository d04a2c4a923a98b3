//! # farnear-capture
//!
//! Talks to the rig and takes pictures with it; blocking, no async runtime.
//!
//! - [`transport`], [`client`], [`work`], [`stream`]: the serial port, handles of the board behind it, long work with its
//!   end, and the board's events and log.
//! - [`camera`]: where images come from.
//! - [`ready`], [`plan`], [`pair`], [`record`]: homing, where the axes go for a pair, taking it, and the folder it is kept in.
//! - [`expose`], [`focus`], [`sequence`]: programs with a camera: finding the focus, focus stacks, programs from a file.
//! - [`board_correction`]: depth correction by the board's own mathematics.
//! - [`timing`]: how long the host waits, and why.
//! - [`error`], [`describe`]: what can go wrong, in words.
//!
//! ```no_run
//! use farnear_capture::Client;
//! use farnear_protocol::message::Axis;
//!
//! let rig = Client::open("/dev/ttyACM0")?;
//! rig.home(Axis::SensorCoarse)?;
//! # Ok::<(), farnear_capture::ClientError>(())
//! ```

pub mod board_correction;
pub mod camera;
pub mod client;
pub mod describe;
pub mod error;
mod events;
pub mod expose;
pub mod focus;
mod handshake;
mod link;
mod owner;
pub mod pair;
pub mod plan;
pub mod ready;
pub mod record;
mod requests;
pub mod sequence;
pub mod stream;
pub mod timing;
pub mod transport;
pub mod work;

pub use client::Client;
pub use error::{ClientError, PortError};
pub use owner::Connect;
pub use stream::{LogPart, News, Stream};
pub use timing::Timing;
pub use transport::{SerialTransport, Transport};
pub use work::{Step, Work};
