//! `farnear rig correct`: the board corrects a depth map, and this computer checks its bits.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::corrections::Method;
use farnear_workflows::rig::correct::{self, BoardCorrectSettings};

use super::Target;
use crate::{report, terminal};

/// Let the board correct a depth map, row by row over the link, and compare its bits with this computer's.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig correct depth.npy --port sim --correction correction.toml --out corrected.npy"
)]
pub struct Arguments {
    /// The depth map in mm, .npy or float .tiff.
    depth: PathBuf,
    #[command(flatten)]
    target: Target,
    #[arg(
        long,
        value_name = "FILE",
        help = format!("The correction, as `farnear calibrate correction` saves it: {}", Method::board_names())
    )]
    correction: PathBuf,
    /// Where to write the corrected map: .npy or .tiff.
    #[arg(long, value_name = "DEPTH")]
    out: PathBuf,
    /// Keep the correction in the board's memory.
    #[arg(long)]
    store: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { depth, target, correction, out, store, json } = arguments;
    let settings = BoardCorrectSettings { rig: target.address()?, depth, correction, out, store };
    let figures = correct::correct(&settings, &terminal::context()?)?;
    report::print(&figures, json)?;
    Ok(figures.check()?)
}
