//! # farnear-capture
//!
//! Talks to the rig and takes pictures with it; blocking, no async runtime.
//!
//! - [`transport`], [`client`], [`work`]: the serial port, a session on it, and long work with its end.
//! - [`timing`]: how long the host waits, and why.
//! - [`error`], [`describe`]: what can go wrong, in words.
//!
//! ```no_run
//! use farnear_capture::Client;
//! use farnear_protocol::message::Axis;
//!
//! let mut rig = Client::open("/dev/ttyACM0")?;
//! rig.home(Axis::SensorCoarse)?;
//! # Ok::<(), farnear_capture::ClientError>(())
//! ```

pub mod client;
pub mod describe;
pub mod error;
mod handshake;
mod link;
pub mod timing;
pub mod transport;
pub mod work;

pub use client::Client;
pub use error::{ClientError, PortError};
pub use timing::Timing;
pub use transport::{SerialTransport, Transport};
