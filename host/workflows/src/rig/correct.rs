//! Depth correction on the board, row by row over the link, compared bit by bit with this computer.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use farnear_capture::board_correction::{decode, encode};
use farnear_files::{map::Format, staging};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    correct::{format_of, read_depth},
    correction_file,
    error::{Result, WorkflowError},
    figures::rounded,
    request::{PathKind, Request},
};

/// Let the board correct a depth map, row by row over the link, and compare its bits with this computer's.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig correct depth.npy --port sim --correction correction.toml --out corrected.npy"
    )
)]
#[serde(default)]
pub struct BoardCorrectRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    /// The depth map in mm, .npy or float .tiff.
    pub depth: PathBuf,
    /// The correction, as `farnear calibrate correction` saves it: clsf, clsf-blend or clsf-full.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub correction: PathBuf,
    /// The corrected map: .npy or .tiff.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEPTH"))]
    pub out: PathBuf,
    /// Keep the correction in the board's memory.
    #[cfg_attr(feature = "clap", arg(long))]
    pub store: bool,
}

impl Request for BoardCorrectRequest {
    const NAME: &'static str = "rig correct";
    const REQUIRED: &'static [&'static str] = &["depth", "correction", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("depth", PathKind::Input), ("correction", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = BoardCorrectFigures;

    fn run(&self, context: &Context<'_>) -> Result<BoardCorrectFigures> {
        correct(self, context)
    }

    fn verdict(figures: &BoardCorrectFigures) -> Result<()> {
        figures.check()
    }
}

crate::request::rig_request!(BoardCorrectRequest);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct BoardCorrectFigures {
    pub method: String,
    pub width: usize,
    pub height: usize,
    /// Change of depth; positive = farther.
    pub mean_change_mm: f64,
    pub different_pixels: usize,
    pub rows_per_second: f64,
    #[serde(skip)]
    pub first_difference: Option<PixelDifference>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PixelDifference {
    pub row: usize,
    pub column: usize,
    pub board_mm: f32,
    pub host_mm: f32,
}

impl BoardCorrectFigures {
    pub fn check(&self) -> Result<()> {
        let Some(PixelDifference { row, column, board_mm, host_mm }) = self.first_difference else {
            return Ok(());
        };
        Err(WorkflowError::Differs(format!(
            "{} pixels, the first in row {row}, column {column}: {board_mm} against {host_mm} mm",
            self.different_pixels
        )))
    }
}

/// Corrects a map on the board. Fails if correction and map do not match.
pub fn correct(settings: &BoardCorrectRequest, context: &Context<'_>) -> Result<BoardCorrectFigures> {
    let format = format_of(&settings.out)?;
    let correction = correction_file::read(&settings.correction)?;
    let depth = read_depth(&settings.depth, context)?;
    // The expected result. Also checks that map and correction match.
    let expected = correction.apply_as_board(depth.view())?;
    let board = correction.for_board()?;
    let rig = Rig::connect(&settings.rig, None, context)?;
    rig.client.send_correction(&board)?;
    let (height, width) = depth.dim();
    let begin = Instant::now();
    let codes = encode(depth.view(), board.scale);
    let corrected = rig.client.correct_codes(codes.view(), &mut |row| {
        if row % 60 == 0 || row == height {
            context.info(&format!("{row} of {height} rows"));
        }
    })?;
    let seconds = begin.elapsed().as_secs_f64();
    let corrected = decode(corrected.view(), board.scale);
    let (different_pixels, first_difference) = publish(&settings.out, format, &corrected, &expected)?;
    if different_pixels == 0 {
        context.info(&format!("wrote {}", settings.out.display()));
        if settings.store {
            rig.client.store_correction()?;
        }
    }
    Ok(BoardCorrectFigures {
        method: correction.method().to_string(),
        width,
        height,
        mean_change_mm: rounded(mean_change_mm(&depth, &corrected), 4),
        different_pixels,
        rows_per_second: rounded(height as f64 / seconds, 1),
        first_difference,
    })
}

/// Writes the board's map if it equals the host's; returns the differences.
fn publish(
    out: &Path,
    format: Format,
    board: &Array2<f32>,
    host: &Array2<f32>,
) -> Result<(usize, Option<PixelDifference>)> {
    let found = compare(board, host);
    if found.0 == 0 {
        staging::write_file(out, &format.encode(board.view())?)?;
    }
    Ok(found)
}

fn compare(board: &Array2<f32>, host: &Array2<f32>) -> (usize, Option<PixelDifference>) {
    let mut different =
        board.indexed_iter().zip(host).filter(|((_, board), host)| board.to_bits() != host.to_bits()).map(
            |(((row, column), board_mm), host_mm)| PixelDifference {
                row,
                column,
                board_mm: *board_mm,
                host_mm: *host_mm,
            },
        );
    let first = different.next();
    (usize::from(first.is_some()) + different.count(), first)
}

fn mean_change_mm(before: &Array2<f32>, after: &Array2<f32>) -> f64 {
    let changes = before.iter().zip(after).map(|(a, b)| f64::from(*b) - f64::from(*a));
    let known = changes.filter(|change| change.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), change| (sum + change, count + 1.0));
    sum / f64::max(count, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_one_of_bits() {
        let host = ndarray::array![[1.0, f32::NAN], [3.0, 4.0]];
        assert_eq!(compare(&host.clone(), &host), (0, None), "NaN is the same as itself here");
        let board = ndarray::array![[1.0, f32::NAN], [3.5, -4.0]];
        let (count, first) = compare(&board, &host);
        assert_eq!(count, 2);
        assert_eq!(first, Some(PixelDifference { row: 1, column: 0, board_mm: 3.5, host_mm: 3.0 }));
        assert_eq!(mean_change_mm(&host, &board), (0.0 + 0.5 - 8.0) / 3.0);
    }

    #[test]
    fn a_map_with_differences_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("map.npy");
        let host = ndarray::array![[1.0, 2.0]];
        let differs = publish(&out, Format::Npy, &ndarray::array![[1.0, 2.5]], &host).unwrap();
        assert_eq!((differs.0, out.exists()), (1, false));
        let equal = publish(&out, Format::Npy, &host, &host).unwrap();
        assert_eq!((equal, out.exists()), ((0, None), true));
    }
}
