//! `farnear report`: a capture as one page.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::report::{ReportSettings, write};

use crate::report;

/// Write a self-contained HTML page about a capture: pictures, figures and what made them.
#[derive(Args)]
#[command(after_help = "Example: farnear report pair1/ --out pair1.html")]
pub struct Arguments {
    /// The capture's folder.
    capture: PathBuf,
    /// The page.
    #[arg(long, value_name = "FILE.html")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let figures = write(&ReportSettings { capture: arguments.capture, out: arguments.out })?;
    report::print(&figures, arguments.json)
}
