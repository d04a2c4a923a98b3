//! Figures on stdout: lines of text, or one JSON object with `--json`.

use std::io::Write;

use anyhow::{Context, Result};
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

/// Prints one line of JSON.
pub fn line<T: Serialize>(figures: &T) -> std::io::Result<()> {
    let text = serde_json::to_string(figures)? + "\n";
    let mut stdout = std::io::stdout();
    stdout.write_all(text.as_bytes())?;
    stdout.flush()
}

pub fn print<T: Serialize>(figures: &T, json: bool) -> Result<()> {
    let text = if json { serde_json::to_string(figures)? + "\n" } else { toml::to_string(figures)? };
    to_stdout(text.as_bytes())
}

/// Returns an error, without a panic, for a closed pipe or a full disk.
pub fn to_stdout(bytes: &[u8]) -> Result<()> {
    let mut stdout = std::io::stdout();
    stdout.write_all(bytes).and_then(|()| stdout.flush()).context("cannot write to the standard output")
}
