use std::{io, path::PathBuf};

#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("cannot write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("{}: a manifest's name ends in .toml or .csv", path.display())]
    Ending { path: PathBuf },
    #[error("{}, line {line}: {reason}", path.display())]
    Manifest { path: PathBuf, line: usize, reason: String },
    #[error("{} holds no jobs: expected [[job]] tables, or rows below the header of a CSV", path.display())]
    Empty { path: PathBuf },
    #[error("{0}")]
    Pattern(String),
    #[error("unknown job `{name}`; expected {known}")]
    UnknownKind { name: String, known: String },
    #[error("the field `{name}` is missing")]
    MissingField { name: &'static str },
    #[error("the field `{name}` is given twice: expected each field once")]
    RepeatedField { name: String },
    #[error("the field `{name}` is {value}: {reason}")]
    Field { name: String, value: String, reason: String },
    #[error(
        "{} exists and was not made by a batch (batch.toml is missing): name another place or remove it", path.display()
    )]
    Foreign { path: PathBuf },
    #[error("another batch is making {} now: run the batch again after it has ended", path.display())]
    InUse { path: PathBuf },
    #[error("the input {} is the result of the job on line {line}: move this job behind that one", path.display())]
    Order { path: PathBuf, line: usize },
    #[error("cannot write the {what} to {}: {reason}; name another file with --{what}", path.display())]
    Report { what: &'static str, path: PathBuf, reason: String },
    #[error("{failed} of {jobs} jobs failed; {} says why; run the batch again to do them again", failures.display())]
    Failed { failed: usize, jobs: usize, failures: PathBuf },
    #[error("{failed} of {jobs} jobs would fail; their lines of the output say why")]
    WouldFail { failed: usize, jobs: usize },
    #[error("cannot start a thread: {0}")]
    Threads(String),
}

impl BatchError {
    pub(super) fn field(name: impl Into<String>, value: impl ToString, reason: impl ToString) -> Self {
        Self::Field { name: name.into(), value: value.to_string(), reason: reason.to_string() }
    }
}
