//! `farnear rig correct`: the board corrects a depth map, and this computer checks its bits.

use std::{path::PathBuf, time::Instant};

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::{
    aside,
    board_correction::{decode, encode},
};
use farnear_depth::corrections::Method;
use ndarray::s;
use serde::Serialize;

use super::Target;
use crate::{
    files::{self, map},
    report::{self, Usage},
};

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

#[derive(Serialize)]
struct Figures {
    method: String,
    width: usize,
    height: usize,
    /// Mean change, mm; positive = farther.
    mean_change_mm: f64,
    /// Pixels whose bits differ from this computer's calculation.
    different_pixels: usize,
    rows_per_second: f64,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let extension = arguments.out.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if !["npy", "tif", "tiff"].contains(&extension.as_str()) {
        bail!(Usage(format!("--out {}: depth maps are written as .npy or .tiff", arguments.out.display())));
    }
    let correction = files::correction::read(&arguments.correction)?;
    let depth = map::read(&arguments.depth)?;
    // What the board has to give; also finds out whether map and correction belong together.
    let expected = correction.apply_as_board(depth.view())?;
    let board = correction.for_board()?;
    let rig = arguments.target.connect(None)?;
    rig.client.send_correction(&board)?;
    if arguments.store {
        rig.client.store_correction()?;
    }
    let (height, width) = depth.dim();
    let begin = Instant::now();
    let codes = encode(depth.view(), board.scale);
    let corrected = rig.client.correct_codes(codes.view(), &mut |row| {
        if row % 60 == 0 || row == height {
            eprintln!("{row} of {height} rows");
        }
    })?;
    let seconds = begin.elapsed().as_secs_f64();
    let corrected = decode(corrected.view(), board.scale);
    let bytes = if extension == "npy" { map::npy(corrected.view())? } else { map::tiff(corrected.view())? };
    aside::write_file(&arguments.out, &bytes)?;
    eprintln!("wrote {}", arguments.out.display());

    let different: Vec<_> = corrected
        .indexed_iter()
        .filter(|(place, value)| value.to_bits() != expected[*place].to_bits())
        .map(|(place, _)| place)
        .collect();
    let changes =
        depth.iter().zip(&corrected).map(|(a, b)| f64::from(*b) - f64::from(*a)).filter(|d| d.is_finite());
    let (sum, count) = changes.fold((0.0, 0.0), |(sum, count), change| (sum + change, count + 1.0));
    let figures = Figures {
        method: correction.method().to_string(),
        width,
        height,
        mean_change_mm: report::rounded(sum / f64::max(count, 1.0), 4),
        different_pixels: different.len(),
        rows_per_second: report::rounded(height as f64 / seconds, 1),
    };
    report::print(&figures, arguments.json)?;
    if let Some((row, column)) = different.first() {
        bail!(
            "{} pixels differ from this computer's calculation, the first in row {row}, column {column}: {:?} against {:?}",
            different.len(),
            corrected.slice(s![*row, *column]),
            expected.slice(s![*row, *column])
        );
    }
    Ok(())
}
