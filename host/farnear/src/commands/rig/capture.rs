//! `farnear rig capture`: a far- and a near-focused image into a capture folder.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::rig::pair::{self, PairSettings};

use super::{CameraArguments, Target};
use crate::{report, terminal};

/// Capture a far- and a near-focused image: homes where needed, brings the stage near, exposes both by piezo.
///
/// The folder appears when everything is in it: far.png, near.png and capture.toml.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig capture --port /dev/ttyACM0 --camera folder:incoming/ --optics optics.toml --out pair1/"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// The new capture folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let settings = PairSettings {
        rig: arguments.target.address()?,
        camera: arguments.camera.settings()?,
        optics: arguments.optics,
        out: arguments.out,
    };
    report::print(&pair::capture(&settings, &terminal::context()?)?, arguments.json)
}
