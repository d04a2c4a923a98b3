//! `farnear rig continuous`: exposures without an end, at a pace that the board holds.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::continuous::{self, ContinuousSettings, Cycle, Enough};

use super::{CameraArguments, Target};
use crate::{report, terminal};

/// Capture far, near, far, near ... (or any cycle of shots) until it is enough or Ctrl-C ends it: homes where needed, brings the
/// stage near, and lets the board hold the pace.
///
/// Prints exposures per second, dropped frames with reasons, and the accuracy of the rate. With --out each pair is
/// kept as a capture folder (pair-00000, pair-00001, ...) that `farnear depth` takes; frames.csv has a row for each frame.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig continuous --port sim --optics optics.toml --rate 30 --for 10 --out run/"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file: far and near focus in turn.
    #[arg(long, value_name = "FILE", required_unless_present = "program", conflicts_with = "program")]
    optics: Option<PathBuf>,
    /// A cycle of up to 64 shots instead, a program as `farnear rig sequence` takes it.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Exposures a second, each at its microsecond [default: as fast as position and camera allow, about 50].
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// End after this many seconds of the board's time.
    #[arg(long = "for", value_name = "S", conflicts_with = "frames")]
    seconds: Option<f64>,
    /// End after this many exposures.
    #[arg(long, value_name = "N")]
    frames: Option<u32>,
    /// Keep the images in this new folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let cycle = match (arguments.optics, arguments.program) {
        (_, Some(path)) => Cycle::Program { path },
        (optics, None) => Cycle::Pair { optics: optics.unwrap_or_default() }, // one of both is required
    };
    let enough = match (arguments.seconds, arguments.frames) {
        (Some(seconds), _) => Enough::Seconds(seconds),
        (None, Some(frames)) => Enough::Exposures(frames),
        (None, None) => Enough::Never,
    };
    let settings = ContinuousSettings {
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        cycle,
        rate_hz: arguments.rate,
        enough,
        out: arguments.out,
    };
    report::print(&continuous::run(&settings, &terminal::counting(arguments.json)?)?, arguments.json)
}
