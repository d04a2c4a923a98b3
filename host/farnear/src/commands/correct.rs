//! `farnear correct`: applies a correction to a depth map.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::corrections::Method;
use farnear_workflows::correct::{self, CorrectSettings};

use crate::{report, terminal};

/// Correct a depth map with what `farnear calibrate correction` learned.
#[derive(Args)]
#[command(after_help = "Example: farnear correct depth.npy --correction correction.toml --out corrected.npy")]
pub struct Arguments {
    /// The depth map in mm, .npy or float .tiff.
    depth: PathBuf,
    /// The correction.
    #[arg(long, value_name = "FILE")]
    correction: PathBuf,
    /// Where to write the corrected map: .npy or .tiff.
    #[arg(long, value_name = "DEPTH")]
    out: PathBuf,
    #[arg(
        long,
        help = format!("Compute in the board's fixed-point arithmetic, bit for bit ({})", Method::board_names())
    )]
    as_board: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { depth, correction, out, as_board, json } = arguments;
    let settings = CorrectSettings { depth, correction, out, as_board };
    report::print(&correct::apply(&settings, &terminal::context()?)?, json)
}
