//! Compares a depth map with ground truth.

use std::path::PathBuf;

use farnear_depth::metrics::{self, CompareSettings, Comparison};
use farnear_files::map;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};

use crate::{
    context::Context,
    error::Result,
    measure::{Entries, Unit, read_two},
    request::{PathKind, Request},
};

/// Compare a depth map with the true one: root-mean-square, mean, 95th percentile and bias of the error.
///
/// Both maps are in one unit (mm, um or numbers of images), which ends the names of the figures.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear compare depth.npy truth.npy --border 16 --away-from-edges 8 --json"
    )
)]
#[serde(default)]
pub struct CompareRequest {
    /// The depth map: a result folder, .npy, float .tiff, or the depth.png of a result.
    pub depth: PathBuf,
    /// The true depth, likewise.
    pub truth: PathBuf,
    /// Leave out a rim of this width.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = 0))]
    pub border: usize,
    /// Count only pixels where this image, or .npy of bool or numbers, is not 0.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub mask: Option<PathBuf>,
    /// Leave out pixels that are not farther than this from a step of the true depth.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX"))]
    pub away_from_edges: Option<usize>,
}

impl Request for CompareRequest {
    const NAME: &'static str = "compare";
    const REQUIRED: &'static [&'static str] = &["depth", "truth"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("depth", PathKind::Input), ("truth", PathKind::Input), ("mask", PathKind::Input)];
    type Figures = ComparisonFigures;

    fn run(&self, context: &Context<'_>) -> Result<ComparisonFigures> {
        compare(self, context)
    }
}

/// In the unit of the maps.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ComparisonFigures {
    pub unit: Unit,
    pub found: Comparison,
}

impl Serialize for ComparisonFigures {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        let found = &self.found;
        let mut to = Entries::new(to.serialize_map(None)?, self.unit);
        to.length("rmse", Some(found.rmse_mm))?;
        to.length("mae", Some(found.mae_mm))?;
        to.length("p95", Some(found.p95_mm))?;
        to.length("bias", Some(found.bias_mm))?;
        if self.unit == Unit::Mm {
            to.field("rmse_percent_of_depth", &found.rmse_percent_of_depth)?;
        }
        to.field("pixels", &found.pixels)?;
        to.field("missing_fraction", &found.missing_fraction)?;
        to.field("pixels_without_truth", &found.pixels_without_truth)?;
        to.end()
    }
}

/// Fails for maps in different units.
pub fn compare(request: &CompareRequest, context: &Context<'_>) -> Result<ComparisonFigures> {
    let ([mut depth, mut truth], unit) = read_two("truth", [&request.depth, &request.truth], context)?;
    if unit == Unit::Um {
        // Positions may have any sign; a common offset above 0 keeps the errors.
        let lowest = depth.iter().chain(&truth).copied().fold(0.0, f32::min);
        for map in [&mut depth, &mut truth] {
            map.mapv_inplace(|z| z - lowest + 1.0);
        }
    }
    let mask = request.mask.as_deref().map(map::read_mask).transpose()?;
    let mask = mask.as_ref().map(|mask| mask.view());
    let pixels = CompareSettings { border_px: request.border, away_from_edges_px: request.away_from_edges };
    let found = metrics::compare(depth.view(), truth.view(), mask, &pixels)?;
    Ok(ComparisonFigures { unit, found })
}
