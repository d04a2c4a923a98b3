//! `farnear compare`: how near a depth map comes to the truth.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::metrics::CompareSettings;
use farnear_workflows::compare::{ComparisonSettings, compare};

use crate::report;

/// Compare a depth map with the true one: root-mean-square, mean, 95th percentile and bias of the error.
#[derive(Args)]
#[command(after_help = "Example: farnear compare depth.npy truth.npy --border 16 --away-from-edges 8 --json")]
pub struct Arguments {
    /// The depth map in mm, .npy or float .tiff.
    depth: PathBuf,
    /// The true depth in mm, .npy or float .tiff.
    truth: PathBuf,
    /// Leave out a rim of this width.
    #[arg(long, value_name = "PX", default_value_t = 0)]
    border: usize,
    /// Count only pixels where this image is not black.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Leave out pixels that are not farther than this from a step of the true depth.
    #[arg(long, value_name = "PX")]
    away_from_edges: Option<usize>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { depth, truth, border, mask, away_from_edges, json } = arguments;
    let pixels = CompareSettings { border_px: border, away_from_edges_px: away_from_edges };
    report::print(&compare(&ComparisonSettings { depth, truth, mask, pixels })?, json)
}
