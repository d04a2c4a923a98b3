use std::path::PathBuf;

use thiserror::Error;

/// The text has no causes: print it with its sources, as `{:#}` of `anyhow` does.
#[derive(Debug, Error)]
pub enum SimError {
    #[error("{} has {length} bytes, the board's memory {expected}: name a file that an earlier run wrote, or a new one", path.display())]
    Memory { path: PathBuf, length: usize, expected: usize },
    #[error("{} was changed during this run, whose memory is not written: give each rig its own file", path.display())]
    MemoryChanged { path: PathBuf },
    #[error("{} has something else than a trace, which would replace it: name another file for the trace", .0.display())]
    NotATrace(PathBuf),
    #[error("no firmware at {}: run `cargo xtask firmware` to build it, or name an ELF with --firmware", .0.display())]
    NoFirmware(PathBuf),
    #[error("the firmware {} cannot be loaded: {reason}", path.display())]
    Firmware { path: PathBuf, reason: String },
    #[error(
        "the firmware did not start within {millis} ms of board time: is {} built for this board?",
        path.display()
    )]
    NotStarted { path: PathBuf, millis: u64 },
    #[error("scenario {}: {reason}", path.display())]
    Scenario { path: PathBuf, reason: String },
    #[error("parts file {}: {reason}", path.display())]
    Parts { path: PathBuf, reason: String },
    #[error("{}: {reason}", path.display())]
    Replay { path: PathBuf, reason: String },
    #[error("the emulator stopped: {0}")]
    Emulator(String),
    #[error("the emulated board has stopped")]
    Stopped,
    #[error("{what}")]
    Io { what: String, source: std::io::Error },
    #[cfg(unix)]
    #[error("cannot make a pty")]
    Port(#[from] serialport::Error),
    #[error("the camera cannot render: {0}")]
    Scene(String),
    #[error(transparent)]
    Gige(#[from] farnear_gige::OpenError),
}
