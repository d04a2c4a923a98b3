//! How near a depth map comes to the truth, from files.

use std::path::PathBuf;

use farnear_depth::metrics::{self, CompareSettings, Comparison};
use farnear_files::map;

use crate::{
    error::{Result, WorkflowError},
    measure::unit_of,
};

/// The files, and which pixels count.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ComparisonSettings {
    /// The depth map in mm, `.npy` or float TIFF.
    pub depth: PathBuf,
    /// The true depth in mm, `.npy` or float TIFF.
    pub truth: PathBuf,
    /// A picture that is not black where pixels count.
    pub mask: Option<PathBuf>,
    /// Rim and steps that do not count.
    pub pixels: CompareSettings,
}

/// Compares a map with the truth.
///
/// # Errors
/// [`crate::WorkflowError::Map`], [`crate::WorkflowError::Image`] for the mask, [`crate::WorkflowError::Compare`].
pub fn compare(settings: &ComparisonSettings) -> Result<Comparison> {
    let unit = unit_of(&settings.depth)?;
    if unit != "mm" {
        return Err(WorkflowError::parameter(
            "depth",
            settings.depth.display(),
            format!(
                "a depth map in mm, not in {unit} as its stack.toml gives; measure the stack with --distances-mm"
            ),
        ));
    }
    let depth = map::read(&settings.depth)?;
    let truth = map::read(&settings.truth)?;
    let mask = settings.mask.as_deref().map(map::read_mask).transpose()?;
    let mask = mask.as_ref().map(|mask| mask.view());
    Ok(metrics::compare(depth.view(), truth.view(), mask, &settings.pixels)?)
}
