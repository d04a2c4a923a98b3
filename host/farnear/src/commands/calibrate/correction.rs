//! `farnear calibrate correction`: learns a correction from depth maps of flat targets at known depths.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::corrections::{CdcSettings, Method};
use farnear_workflows::calibrate::correction::{self, CorrectionSettings};

use crate::{report, terminal};

/// Learn a correction of the elliptical distortion from depth maps of flat targets at known depths.
///
/// PATTERNS.toml lists the maps, paths relative to itself. 20 to 30 targets through the working range teach any method.
#[derive(Args)]
#[command(after_help = "\
PATTERNS.toml has an entry for each map:
  [[pattern]]
  depth = \"target-01/depth.npy\"
  true_mm = 933.0

Example: farnear calibrate correction patterns.toml --method clsf-full --out correction.toml")]
pub struct Arguments {
    /// The list of depth maps.
    patterns: PathBuf,
    #[arg(long, help = Method::choices())]
    method: Method,
    /// Where to save the correction.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// cdc: N of its window of 2 N + 1 pixels.
    #[arg(long, value_name = "PX", default_value_t = CdcSettings::default().window)]
    window: usize,
    /// cdc: standard deviation by which patterns are smoothed; 0 = as measured.
    #[arg(long, value_name = "PX", default_value_t = CdcSettings::default().smoothing_px)]
    smooth_patterns: f64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { patterns, method, out, window, smooth_patterns: smoothing_px, json } = arguments;
    let settings = CorrectionSettings { patterns, method, cdc: CdcSettings { window, smoothing_px }, out };
    report::print(&correction::learn(&settings, &terminal::context()?)?, json)
}
