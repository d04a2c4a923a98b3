//! Figures on stdout: lines of text, or one JSON object with `--json`.

use std::io::{self, ErrorKind, Write};

use anyhow::Result;
use serde::Serialize;

/// Contradictory options: exit code 2, as for the argument parser.
#[derive(Debug)]
pub struct Usage(pub String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// The reader of stdout has closed it, as `head` does: the program ends without a message.
#[derive(Debug)]
struct Closed;

impl std::fmt::Display for Closed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the standard output is closed")
    }
}

impl std::error::Error for Closed {}

/// Exit code after [`is_closed`], as of a program that SIGPIPE ends.
pub const CLOSED: u8 = 141;

/// Whether the error is that of a stdout that its reader has closed.
pub fn is_closed(error: &anyhow::Error) -> bool {
    let errors = error.chain().filter_map(|cause| cause.downcast_ref::<io::Error>());
    errors.filter_map(io::Error::get_ref).any(|inner| inner.is::<Closed>())
}

/// Prints one line of JSON.
pub fn line<T: Serialize>(figures: &T) -> io::Result<()> {
    to_stdout(&(serde_json::to_string(figures)? + "\n"))
}

pub fn print<T: Serialize>(figures: &T, json: bool) -> Result<()> {
    let text = if json { serde_json::to_string(figures)? + "\n" } else { toml::to_string(figures)? };
    Ok(to_stdout(&text)?)
}

/// Returns an error, without a panic, for a closed pipe or a full disk.
pub fn to_stdout(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    written(stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()))
}

/// The result of writing to stdout, with an error that names it.
pub fn written(result: io::Result<()>) -> io::Result<()> {
    result.map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => io::Error::new(ErrorKind::BrokenPipe, Closed),
        kind => io::Error::new(kind, format!("cannot write to the standard output: {error}")),
    })
}
