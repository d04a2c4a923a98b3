//! `farnear rig focus`: finds m1, the sensor distance of the best focus, and the working range that follows from it.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_depth::focus_measure::FocusMeasure;
use farnear_workflows::rig::focus::{self, FocusSettings};

use super::{CameraArguments, Target};
use crate::{
    report::{self, Usage},
    terminal,
};

/// Find the sensor distance at which a target is sharpest (m1), and the working range that begins there.
///
/// Put the target where the working range shall end far away, and let the rig focus. The second distance
/// follows from the optics: m2 = m1 + 2 Fe Rmax (Li 2014, eqs. 4.3 and 4.4).
#[derive(Args)]
#[command(after_help = "Example: farnear rig focus --port sim --scene plane:900 --optics optics.toml --json")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file; its far focus is where the search begins, unless told otherwise.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Begin at this sensor distance; without it, where the stage stands, or at the optics' far focus if it had to be
    /// homed.
    #[arg(long, value_name = "MM")]
    start_mm: Option<f64>,
    /// How far the focus may be from the start.
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    range_mm: f64,
    /// Focus measure: tenengrad, modified-laplacian or fft-sum.
    #[arg(long, default_value = "tenengrad")]
    measure: FocusMeasure,
    /// The part of the image that counts.
    #[arg(long, value_name = "COLUMN,ROW,WIDTH,HEIGHT", value_delimiter = ',')]
    region: Vec<usize>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let region = match arguments.region[..] {
        [] => None,
        [column, row, width, height] => Some([column, row, width, height]),
        _ => bail!(Usage("--region needs four numbers: COLUMN,ROW,WIDTH,HEIGHT".into())),
    };
    let settings = FocusSettings {
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        optics: arguments.optics,
        start_mm: arguments.start_mm,
        range_mm: arguments.range_mm,
        measure: arguments.measure,
        region,
    };
    report::print(&focus::focus(&settings, &terminal::context()?)?, arguments.json)
}
