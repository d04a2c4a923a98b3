//! Why jobs, or one of them, cannot be done.

use std::{io, path::PathBuf};

/// Why jobs, or one of them, cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A result that cannot be put in place.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The place.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Neither TOML nor CSV.
    #[error("{}: a manifest's name ends in .toml or .csv", path.display())]
    Ending {
        /// The manifest.
        path: PathBuf,
    },
    /// A manifest that cannot be understood.
    #[error("{}, line {line}: {reason}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// Where.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// A manifest without jobs.
    #[error("{} holds no jobs: expected [[job]] tables, or rows below the header of a CSV", path.display())]
    Empty {
        /// The manifest.
        path: PathBuf,
    },
    /// A pattern for a new manifest that cannot be used.
    #[error("{0}")]
    Pattern(String),
    /// A job of a kind that is not known.
    #[error("there is no job `{name}`; expected {known}")]
    UnknownKind {
        /// Its name.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// A field that has to be there.
    #[error("the field `{name}` is missing")]
    MissingField {
        /// The field.
        name: &'static str,
    },
    /// A field that nobody knows.
    #[error("there is no field `{name}`; expected some of {known}")]
    UnknownField {
        /// The field.
        name: String,
        /// Those that this kind of job has.
        known: String,
    },
    /// A value that cannot be.
    #[error("the field `{name}` is {value}: {reason}")]
    Field {
        /// The field.
        name: String,
        /// Its value.
        value: String,
        /// What is wrong.
        reason: String,
    },
    /// Something in the place of a result.
    #[error(
        "{} exists already and no batch made it (there is no batch.toml): name another place or remove it", path.display()
    )]
    Foreign {
        /// The place.
        path: PathBuf,
    },
    /// Two jobs for one result.
    #[error("another job of this run has written {}: give each job an `out` of its own", path.display())]
    SharedOut {
        /// The place.
        path: PathBuf,
    },
    /// Two programs at one result.
    #[error("{} is being made by another program", path.display())]
    InUse {
        /// The place.
        path: PathBuf,
    },
    /// Jobs without a result.
    #[error("{failed} of {jobs} jobs failed; {} says why; run the batch again to do them again", failures.display())]
    Failed {
        /// How many.
        failed: usize,
        /// Of how many.
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
