//! `farnear rig capture`: a far- and a near-focused image into a capture folder.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_capture::{
    pair::{Exposures, capture_pair},
    plan::SensorPair,
    record::{begin_folder, finish_folder, record_of},
};
use serde::Serialize;

use super::{
    Target,
    camera::{self, CameraArguments},
};
use crate::{files, report};

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

#[derive(Serialize)]
struct Figures {
    pair_ms: f64,
    far_settle_ms: f64,
    near_settle_ms: f64,
    sensor_far_mm: f64,
    sensor_near_mm: f64,
    width: usize,
    height: usize,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::read(&arguments.optics)?;
    let range = optics.working_range();
    let table: toml::Table = files::optics::text(&arguments.optics)?.parse()?;
    // Before anything moves: a folder that cannot be written is known now.
    let folder = begin_folder(&arguments.out)?;
    let camera = arguments.camera.open_early(&arguments.target)?;
    let rig = arguments.target.connect(Some((&arguments.optics, optics.psf())))?;
    let mut camera = camera::of_rig(camera, &rig)?;
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures = Exposures {
        exposure: arguments.camera.exposure(),
        image_wait: arguments.camera.image_wait(),
        ..Exposures::default()
    };
    let pair =
        capture_pair(&rig.client, camera.as_mut(), &sensor, &exposures, &mut |what| eprintln!("{what}"))?;
    let circumstances = camera::circumstances(&rig, &arguments.target, camera.as_ref(), optics.psf(), table);
    let record = record_of(&pair, &rig.client, circumstances);
    finish_folder(folder, &pair, &record)?;
    eprintln!("wrote {}", arguments.out.display());
    let (height, width) = pair.far.image.pixels.dim();
    let ms = |us: u32| f64::from(us) / 1e3;
    let figures = Figures {
        pair_ms: pair.moving_us() as f64 / 1e3,
        far_settle_ms: ms(pair.far.record.settle.0),
        near_settle_ms: ms(pair.near.record.settle.0),
        sensor_far_mm: pair.far.sensor_measured_mm,
        sensor_near_mm: pair.near.sensor_measured_mm,
        width,
        height,
    };
    report::print(&figures, arguments.json)
}
