//! Applying a correction to a depth map in a file.

use std::path::{Path, PathBuf};

use farnear_files::{
    map::{self, Format},
    staging,
};
use serde::Serialize;

use crate::{
    context::Context,
    correction_file,
    error::{Result, WorkflowError},
    figures::rounded,
};

/// What is corrected, with what, and where it goes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CorrectSettings {
    /// The depth map in mm, `.npy` or float TIFF.
    pub depth: PathBuf,
    /// The file of the correction.
    pub correction: PathBuf,
    /// Where the corrected map goes: `.npy` or `.tiff`.
    pub out: PathBuf,
    /// Whether to calculate in the board's fixed-point arithmetic.
    pub as_board: bool,
}

/// What the correction did.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct CorrectFigures {
    /// Which kind of correction.
    pub method: String,
    /// Mean change, mm; positive = farther.
    pub mean_change_mm: f64,
    /// Pixels that had a depth and have none now, because it lies beyond what the correction was taught.
    pub lost_pixels: usize,
}

/// The format of a map by the name of its file.
///
/// # Errors
/// [`WorkflowError::Parameter`] for another ending.
pub fn format_of(out: &Path) -> Result<Format> {
    let expected = "depth maps are written as .npy or .tiff";
    Format::of(out).ok_or_else(|| WorkflowError::parameter("out", out.display(), expected))
}

/// Corrects a map.
///
/// # Errors
/// [`WorkflowError::Parameter`] for a place with another ending; correction and map that cannot be read or do not belong
/// together.
pub fn apply(settings: &CorrectSettings, context: &Context<'_>) -> Result<CorrectFigures> {
    let format = format_of(&settings.out)?;
    let correction = correction_file::read(&settings.correction)?;
    let depth = map::read(&settings.depth)?;
    context.cancel.check("reading the map")?;
    let corrected = match settings.as_board {
        true => correction.apply_as_board(depth.view())?,
        false => correction.apply(depth.view())?,
    };
    let bytes = format.encode(corrected.view())?;
    context.cancel.check("correcting the map")?;
    staging::write_file(&settings.out, &bytes)?;
    context.say(&format!("wrote {}", settings.out.display()));
    let changes: Vec<f64> = depth
        .iter()
        .zip(&corrected)
        .map(|(a, b)| f64::from(*b) - f64::from(*a))
        .filter(|change| change.is_finite())
        .collect();
    let had = depth.iter().filter(|depth| depth.is_finite()).count();
    let mean_mm = changes.iter().sum::<f64>() / changes.len().max(1) as f64;
    Ok(CorrectFigures {
        method: correction.method().to_string(),
        mean_change_mm: rounded(mean_mm, 4),
        lost_pixels: had - changes.len(),
    })
}
