//! `farnear rig calibrate targets`: the series of flat targets that teaches a correction.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::targets::{self, TargetSettings};

use crate::{
    commands::rig::{CameraArguments, Target},
    report, terminal,
};

/// Capture a flat target at known distances, compute the depth maps, and list them for `farnear calibrate correction`.
///
/// Asks for the target to be placed at each distance. An interrupted series continues when it is
/// started again with the same folder. On the emulated rig the target places itself.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig calibrate targets --port sim --optics optics.toml --distances 890,900,910,920,930 --out series/"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Distances of the target from the lens; asks for nothing then but the target's place [default: 24 through the
    /// working range].
    #[arg(long, value_name = "MM,...", value_delimiter = ',')]
    distances: Vec<f64>,
    /// Do not wait for Enter: the target moves by itself, or the distances do not matter.
    #[arg(long)]
    no_prompt: bool,
    /// Folder of the series.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let settings = TargetSettings {
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        optics: arguments.optics,
        distances_mm: arguments.distances,
        ask: !arguments.no_prompt,
        out: arguments.out,
    };
    report::print(&targets::capture(&settings, &terminal::context()?)?, arguments.json)
}
