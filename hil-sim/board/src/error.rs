//! What can go wrong with the emulated rig itself.

use std::path::PathBuf;

use thiserror::Error;

/// Why the emulated rig cannot start or go on.
#[derive(Debug, Error)]
pub enum SimError {
    /// The memory's file is not one.
    #[error("{} has {length} bytes, the board's memory {expected}: name a file that an earlier run wrote, or a new one", path.display())]
    Memory { path: PathBuf, length: usize, expected: usize },
    /// No firmware where it was looked for.
    #[error("no firmware at {}: run `cargo xtask firmware` to build it, or name an ELF with --firmware", .0.display())]
    NoFirmware(PathBuf),
    /// The firmware file is there but cannot be used.
    #[error("the firmware {} cannot be loaded: {reason}", path.display())]
    Firmware {
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The firmware did not say that it started.
    #[error(
        "the firmware did not start within {millis} ms of board time: is {} built for this board?",
        path.display()
    )]
    NotStarted {
        path: PathBuf,
        /// How long it was given.
        millis: u64,
    },
    /// The scenario's file is wrong.
    #[error("scenario {}: {reason}", path.display())]
    Scenario {
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The file of the parts is wrong.
    #[error("parts file {}: {reason}", path.display())]
    Parts {
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A trace cannot be replayed.
    #[error("{}: {reason}", path.display())]
    Replay { path: PathBuf, reason: String },
    /// The emulator's description of the chip, or the emulation itself, failed.
    #[error("the emulator stopped: {0}")]
    Emulator(String),
    /// The emulator has ended, so nothing can be asked of it.
    #[error("the emulated board has stopped")]
    Stopped,
    /// A file, the pty or the camera endpoint.
    #[error("{what}: {source}")]
    Io {
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The pty cannot be made.
    #[error("cannot make a pty: {0}")]
    Port(#[from] serialport::Error),
    /// What the camera looks at or through makes no picture.
    #[error("the camera cannot render: {0}")]
    Scene(String),
    /// The GigE Vision camera.
    #[error(transparent)]
    Gige(#[from] farnear_gige::OpenError),
}
