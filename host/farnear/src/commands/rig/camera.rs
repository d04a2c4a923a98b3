//! The camera that goes with a rig, as users name it.

use std::time::Duration;

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::{
    camera::{Camera, FolderCamera, SimCamera},
    record::Circumstances,
};
use farnear_depth::psf::Psf;
use farnear_protocol::Micros;

use super::{Connected, Target};
use crate::{files, report::Usage};

/// Which camera, and how it exposes.
#[derive(Args, Clone)]
pub struct CameraArguments {
    /// Camera: sim (with --port sim), HOST:PORT of a farnear-sim, or folder:DIR where images appear.
    #[arg(long, value_name = "CAMERA", default_value = "sim")]
    pub camera: String,
    /// Exposure time in microseconds.
    #[arg(long, value_name = "US", default_value_t = 5_000)]
    pub exposure_us: u32,
    /// Longest wait for an image in seconds.
    #[arg(long, value_name = "S", default_value_t = 30)]
    pub image_wait_s: u64,
}

const SIM_CAMERA_ALONE: &str =
    "--camera sim belongs to --port sim; with another port give HOST:PORT or folder:DIR as the camera";

impl CameraArguments {
    /// The exposure time.
    pub fn exposure(&self) -> Micros {
        Micros(self.exposure_us)
    }

    /// Longest wait for an image.
    pub fn image_wait(&self) -> Duration {
        Duration::from_secs(self.image_wait_s)
    }

    /// The camera, unless it is the one that comes with the emulated rig. Opened before the rig, so that a camera that
    /// is not there is known before anything moves.
    pub fn open_early(&self, target: &Target) -> Result<Option<Box<dyn Camera>>> {
        let name = self.camera.as_str();
        if name == "sim" {
            return if target.is_emulated() { Ok(None) } else { bail!(Usage(SIM_CAMERA_ALONE.into())) };
        }
        if let Some(folder) = name.strip_prefix("folder:") {
            return Ok(Some(Box::new(FolderCamera::watch(folder.as_ref())?)));
        }
        if !name.contains(':') {
            bail!(Usage(format!("unknown camera {name:?}: expected sim, HOST:PORT or folder:DIR")));
        }
        Ok(Some(Box::new(SimCamera::connect(name)?)))
    }
}

/// The camera of a rig: the one that was opened early, else the emulated rig's.
pub fn of_rig(early: Option<Box<dyn Camera>>, rig: &Connected) -> Result<Box<dyn Camera>> {
    match (early, &rig.simulator) {
        (Some(camera), _) => Ok(camera),
        (None, Some(simulator)) => Ok(Box::new(SimCamera::connect(simulator.camera())?)),
        (None, None) => bail!(SIM_CAMERA_ALONE),
    }
}

/// What a capture's record says beside what was measured.
pub fn circumstances(
    rig: &Connected,
    target: &Target,
    camera: &dyn Camera,
    psf: Psf,
    optics: toml::Table,
) -> Circumstances {
    Circumstances {
        made_by: concat!("farnear ", env!("CARGO_PKG_VERSION")).into(),
        time: (!rig.client.hello().emulated).then(files::now_rfc3339).flatten(),
        camera: camera.kind(),
        simulation: rig.simulator.as_ref().map(|_| target.scenery.decided(psf)),
        optics,
    }
}
