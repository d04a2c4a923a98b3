//! # farnear-capture
//!
//! Talks to the rig and takes pictures with it; blocking, no async runtime.
//!
//! - [`transport`], [`client`], [`work`]: the serial port, a session on it, and long work with its end.
//! - [`camera`], [`image_file`], [`aside`]: images, their files, and files that are whole or not there.
//! - [`plan`], [`pair`], [`record`]: where the axes go for a pair, taking it, and the folder it is kept in.
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

pub mod aside;
pub mod camera;
pub mod client;
pub mod describe;
pub mod error;
mod handshake;
pub mod image_file;
mod link;
pub mod pair;
pub mod plan;
pub mod record;
pub mod timing;
pub mod transport;
pub mod work;

pub use client::Client;
pub use error::{ClientError, PortError};
pub use timing::Timing;
pub use transport::{SerialTransport, Transport};
