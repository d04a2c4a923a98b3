//! `farnear rig capture`: a far- and a near-focused image into a capture folder.

use std::{path::PathBuf, time::Duration};

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::{
    camera::{Camera, FolderCamera, SimCamera},
    pair::{Exposures, capture_pair},
    plan::SensorPair,
    record::{Circumstances, begin_folder, finish_folder, record_of},
};
use farnear_protocol::Micros;
use serde::Serialize;

use super::Target;
use crate::{
    files,
    report::{self, Usage},
};

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
    /// Camera: sim (with --port sim), HOST:PORT of a farnear-sim, or folder:DIR where images appear.
    #[arg(long, value_name = "CAMERA", default_value = "sim")]
    camera: String,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Exposure time in microseconds.
    #[arg(long, value_name = "US", default_value_t = 5_000)]
    exposure_us: u32,
    /// Longest wait for an image in seconds.
    #[arg(long, value_name = "S", default_value_t = 30)]
    image_wait_s: u64,
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
    let camera = early_camera(&arguments.camera, &arguments.target.port)?;
    let mut rig = arguments.target.connect(Some((&arguments.optics, optics.psf())))?;
    let mut camera = match (camera, &rig.simulator) {
        (Some(camera), _) => camera,
        (None, Some(simulator)) => Box::new(SimCamera::connect(simulator.camera())?),
        (None, None) => bail!(SIM_CAMERA_ALONE),
    };
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures = Exposures {
        exposure: Micros(arguments.exposure_us),
        image_wait: Duration::from_secs(arguments.image_wait_s),
        ..Exposures::default()
    };
    let pair =
        capture_pair(&mut rig.client, camera.as_mut(), &sensor, &exposures, &mut |what| eprintln!("{what}"))?;
    let circumstances = Circumstances {
        made_by: concat!("farnear ", env!("CARGO_PKG_VERSION")).into(),
        time: (!rig.client.hello().emulated).then(files::now_rfc3339).flatten(),
        camera: camera.kind(),
        simulation: rig.simulator.as_ref().map(|_| arguments.target.scenery.decided(optics.psf())),
        optics: table,
    };
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

const SIM_CAMERA_ALONE: &str =
    "--camera sim belongs to --port sim; with another port give HOST:PORT or folder:DIR as the camera";

/// The camera, unless it is the one that comes with the emulated rig. Opened before the rig, so that a camera that
/// is not there is known before anything moves.
fn early_camera(name: &str, port: &str) -> Result<Option<Box<dyn Camera>>> {
    if name == "sim" {
        return if port == "sim" { Ok(None) } else { bail!(Usage(SIM_CAMERA_ALONE.into())) };
    }
    if let Some(folder) = name.strip_prefix("folder:") {
        return Ok(Some(Box::new(FolderCamera::watch(folder.as_ref())?)));
    }
    if !name.contains(':') {
        bail!(Usage(format!("unknown camera {name:?}: expected sim, HOST:PORT or folder:DIR")));
    }
    Ok(Some(Box::new(SimCamera::connect(name)?)))
}
