//! `farnear correct`: applies a correction to a depth map.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::aside;
use farnear_depth::corrections::Method;
use serde::Serialize;

use crate::{
    files::{self, map},
    report,
};

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

#[derive(Serialize)]
struct Figures {
    method: String,
    /// Mean change, mm; positive = farther.
    mean_change_mm: f64,
    /// Pixels that had a depth and have none now, because it lies beyond what the correction was taught.
    lost_pixels: usize,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let extension = arguments.out.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if !["npy", "tif", "tiff"].contains(&extension.as_str()) {
        bail!("--out {}: depth maps are written as .npy or .tiff", arguments.out.display());
    }
    let correction = files::correction::read(&arguments.correction)?;
    let depth = map::read(&arguments.depth)?;
    let corrected = if arguments.as_board {
        correction.apply_as_board(depth.view())?
    } else {
        correction.apply(depth.view())?
    };
    let bytes = if extension == "npy" { map::npy(corrected.view())? } else { map::tiff(corrected.view())? };
    aside::write_file(&arguments.out, &bytes)?;
    eprintln!("wrote {}", arguments.out.display());
    let changes: Vec<f64> = depth
        .iter()
        .zip(&corrected)
        .map(|(a, b)| f64::from(*b) - f64::from(*a))
        .filter(|d| d.is_finite())
        .collect();
    let had = depth.iter().filter(|depth| depth.is_finite()).count();
    let mean = changes.iter().sum::<f64>() / changes.len().max(1) as f64;
    let figures = Figures {
        method: correction.method().to_string(),
        mean_change_mm: report::rounded(mean, 4),
        lost_pixels: had - changes.len(),
    };
    report::print(&figures, arguments.json)
}
