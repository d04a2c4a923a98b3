//! Why jobs, or one of them, cannot be done.

use std::{io, path::PathBuf};

/// Why jobs, or one of them, cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A result that cannot be put in place.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Neither TOML nor CSV.
    #[error("{}: a manifest's name ends in .toml or .csv", path.display())]
    Ending { path: PathBuf },
    /// A manifest that cannot be understood.
    #[error("{}, line {line}: {reason}", path.display())]
    Manifest { path: PathBuf, line: usize, reason: String },
    /// A manifest without jobs.
    #[error("{} holds no jobs: expected [[job]] tables, or rows below the header of a CSV", path.display())]
    Empty { path: PathBuf },
    /// A pattern for a new manifest that cannot be used.
    #[error("{0}")]
    Pattern(String),
    /// A job of a kind that is not known.
    #[error("unknown job `{name}`; expected {known}")]
    UnknownKind {
        name: String,
        /// Those that there are.
        known: String,
    },
    /// A field that has to be there.
    #[error("the field `{name}` is missing")]
    MissingField { name: &'static str },
    /// An unknown field.
    #[error("unknown field `{name}`; expected some of {known}")]
    UnknownField {
        name: String,
        /// Those that this kind of job has.
        known: String,
    },
    /// A value that cannot be.
    #[error("the field `{name}` is {value}: {reason}")]
    Field { name: String, value: String, reason: String },
    /// Something in the place of a result.
    #[error(
        "{} exists and was not made by a batch (batch.toml is missing): name another place or remove it", path.display()
    )]
    Foreign { path: PathBuf },
    /// Two jobs for one result.
    #[error("another job of this run has written {}: give each job another `out`", path.display())]
    SharedOut { path: PathBuf },
    /// Two programs at one result.
    #[error("{} is being made by another program", path.display())]
    InUse { path: PathBuf },
    /// Jobs without a result.
    #[error("{failed} of {jobs} jobs failed; {} says why; run the batch again to do them again", failures.display())]
    Failed {
        failed: usize,
        jobs: usize,
        /// Where each stands with its message.
        failures: PathBuf,
    },
    /// Threads that the system does not give.
    #[error("cannot start a thread: {0}")]
    Threads(String),
}

impl BatchError {
    pub(super) fn field(name: impl Into<String>, value: impl ToString, reason: impl ToString) -> Self {
        Self::Field { name: name.into(), value: value.to_string(), reason: reason.to_string() }
    }
}
