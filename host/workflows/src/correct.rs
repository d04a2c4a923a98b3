//! Applies a correction to a depth map file.

use std::path::{Path, PathBuf};

use farnear_files::{map::Format, staging};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    correction_file,
    error::{Result, WorkflowError},
    figures::rounded_for,
    measure::read_map,
    request::{PathKind, Request},
};

/// Correct a depth map with what `farnear calibrate correction` learned.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear correct depth.npy --correction correction.toml --out corrected.npy"
    )
)]
#[serde(default)]
pub struct CorrectRequest {
    /// The depth map in mm, .npy or float .tiff.
    pub depth: PathBuf,
    /// The correction.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub correction: PathBuf,
    /// The corrected map: .npy or .tiff.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEPTH"))]
    pub out: PathBuf,
    /// Compute in the board's fixed-point arithmetic, bit for bit (corrections that the board has only).
    #[cfg_attr(feature = "clap", arg(long))]
    pub as_board: bool,
}

impl Request for CorrectRequest {
    const NAME: &'static str = "correct";
    const REQUIRED: &'static [&'static str] = &["depth", "correction", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("depth", PathKind::Input), ("correction", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = CorrectFigures;

    fn check(&self) -> Result<()> {
        format_of(&self.out).map(|_| ())
    }

    fn run(&self, context: &Context<'_>) -> Result<CorrectFigures> {
        apply(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct CorrectFigures {
    pub method: String,
    /// Change of depth; positive = farther.
    pub mean_change_mm: f64,
    /// Pixels whose depth was lost because it is outside the correction's range.
    pub lost_pixels: usize,
}

/// Format by file name.
pub fn format_of(out: &Path) -> Result<Format> {
    let expected = "depth maps are written as .npy or .tiff";
    Format::of(out).ok_or_else(|| WorkflowError::parameter("out", out.display(), expected))
}

/// Depths in mm of the map to correct; holes are NaN.
pub(crate) fn read_depth(path: &Path, context: &Context<'_>) -> Result<Array2<f32>> {
    let mut remarks = Vec::new();
    let depth = read_map(path)?.depth_mm("depth", &mut remarks)?;
    remarks.iter().for_each(|remark| context.progress.warn(remark));
    Ok(depth)
}

pub fn apply(settings: &CorrectRequest, context: &Context<'_>) -> Result<CorrectFigures> {
    let format = format_of(&settings.out)?;
    let correction = correction_file::read(&settings.correction)?;
    let depth = read_depth(&settings.depth, context)?;
    context.cancel.check("reading the map")?;
    let corrected = match settings.as_board {
        true => correction.apply_as_board(depth.view())?,
        false => correction.apply(depth.view())?,
    };
    let bytes = format.encode(corrected.view())?;
    context.cancel.check("correcting the map")?;
    staging::write_file(&settings.out, &bytes)?;
    context.info(&format!("wrote {}", settings.out.display()));
    let changes: Vec<f64> = depth
        .iter()
        .zip(&corrected)
        .map(|(a, b)| f64::from(*b) - f64::from(*a))
        .filter(|change| change.is_finite())
        .collect();
    let had = depth.iter().filter(|depth| depth.is_finite()).count();
    let (far_mm, near_mm) = correction.range_mm();
    let mean_mm = changes.iter().sum::<f64>() / changes.len().max(1) as f64;
    Ok(CorrectFigures {
        method: correction.method().to_string(),
        mean_change_mm: rounded_for(far_mm - near_mm, mean_mm, 4),
        lost_pixels: had - changes.len(),
    })
}

#[cfg(test)]
mod tests {
    use farnear_files::npy;

    use super::*;

    #[test]
    fn a_map_in_another_unit_is_refused_and_holes_are_nan() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.npy");
        std::fs::write(&path, npy::write(ndarray::array![[0.0, 905.0]].view())).unwrap();
        let depth = read_depth(&path, &Context::unattended()).unwrap();
        assert!(depth[(0, 0)].is_nan() && depth[(0, 1)] == 905.0);
        std::fs::write(folder.path().join("stack.toml"), "unit = \"image\"\n").unwrap();
        let error = read_depth(&path, &Context::unattended()).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("in mm"), "{error}");
    }
}
