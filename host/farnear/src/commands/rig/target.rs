//! Flags of `farnear rig` that select rig and camera.

use std::{path::PathBuf, time::Duration};

use anyhow::{Result, bail};
use clap::Args;
use farnear_capture::camera::Setting;
use farnear_depth::psf::Psf;
use farnear_protocol::{Micros, message::LightLevels};
use farnear_scene::Noise;
use farnear_workflows::{
    rig::{
        RigAddress,
        camera::{CameraSettings, parse_light},
    },
    simulator::Scenery,
};

use crate::{
    report::Usage,
    scene::{SceneArgument, packed},
};

#[derive(Args, Clone)]
pub struct Target {
    /// Serial port of the board, e.g. /dev/ttyACM0; tcp:HOST:PORT of a farnear-sim or serial server; or sim, to start the
    /// emulated rig. Without it the only NUCLEO that is plugged in. /dev/ttyACM0@921600 asks for that rate of the link,
    /// for adapters that lose bytes at 2000000.
    #[arg(long, value_name = "PORT|sim", env = "FARNEAR_PORT")]
    port: Option<String>,
    #[command(flatten)]
    scenery: SceneryArguments,
}

/// What the emulated rig sees; goes with `--port sim` only.
#[derive(Args, Clone)]
#[command(next_help_heading = "Emulated rig (--port sim)")]
struct SceneryArguments {
    /// Scene before the emulated camera: plane:MM, staircase, slant, cone, sphere or a scene file as `farnear render` has
    /// them [default: staircase].
    #[arg(long, value_parser = checked::<SceneArgument>)]
    scene: Option<String>,
    /// Point spread function of the emulated lens [default: the one of the optics file].
    #[arg(long, value_parser = checked::<Psf>)]
    psf: Option<String>,
    /// Noise of the emulated camera: none, 8bit or 12bit [default: 8bit].
    #[arg(long, value_parser = checked::<Noise>)]
    noise: Option<String>,
    /// Decides everything random [default: 1].
    #[arg(long)]
    seed: Option<u64>,
    /// The firmware [default: the one next to farnear-sim].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Faults of the emulated line, a TOML file.
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Write what the emulated mechanics really did to this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Let the emulated rig's time follow the clock on the wall, to watch it; runs do not repeat then.
    #[arg(long)]
    paced: bool,
}

/// Checks that the text parses as a `T`; the simulator parses it again.
pub fn checked<T: std::str::FromStr>(text: &str) -> Result<String, T::Err> {
    text.parse::<T>().map(|_| text.to_owned())
}

impl SceneryArguments {
    /// The first flag of these that was given.
    fn given(&self) -> Option<&'static str> {
        [
            ("--scene", self.scene.is_some()),
            ("--psf", self.psf.is_some()),
            ("--noise", self.noise.is_some()),
            ("--seed", self.seed.is_some()),
            ("--firmware", self.firmware.is_some()),
            ("--faults", self.faults.is_some()),
            ("--trace", self.trace.is_some()),
            ("--paced", self.paced),
        ]
        .into_iter()
        .find_map(|(flag, given)| given.then_some(flag))
    }
}

impl Target {
    pub fn address(&self) -> Result<RigAddress> {
        let Some(port) = &self.port else {
            self.without_scenery("a real rig")?;
            return Ok(RigAddress::Attached);
        };
        if port == "sim" {
            let SceneryArguments { scene, psf, noise, seed, firmware, faults, trace, paced } =
                self.scenery.clone();
            let packed_scene = packed(scene.as_deref())?;
            let scenery = Scenery {
                scene,
                packed_scene,
                psf,
                noise,
                seed,
                firmware,
                faults,
                trace,
                paced,
                half_mirror_um: None,
            };
            return Ok(RigAddress::Emulated(scenery));
        }
        self.without_scenery(port)?;
        Ok(RigAddress::Port(port.clone()))
    }

    fn without_scenery(&self, rig: &str) -> Result<()> {
        match self.scenery.given() {
            Some(flag) => {
                bail!(Usage(format!("{flag} goes with --port sim only; the scene of {rig} cannot be set")))
            }
            None => Ok(()),
        }
    }
}

/// Which camera, and how it exposes.
#[derive(Args, Clone)]
pub struct CameraArguments {
    /// Camera: sim (with --port sim), HOST:PORT of a farnear-sim, folder:DIR where images appear, command:"PROGRAM ...",
    /// v4l:/dev/videoN or genicam:ID (docs/cameras.md).
    #[arg(long, value_name = "CAMERA", default_value = "sim")]
    camera: String,
    /// Exposure time in microseconds.
    #[arg(long, value_name = "US", default_value_t = 5_000)]
    exposure_us: u32,
    /// Longest wait for an image in seconds.
    #[arg(long, value_name = "S", default_value_t = 30)]
    image_wait_s: u64,
    /// Set this on the camera first, as far as its kind has it: gain, black_level, pixel_format, region (column,row,width,height),
    /// trigger_source; may be given several times. `farnear camera show` has the ranges.
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<Setting>,
    /// Switch the board's light outputs on during each exposure, in percent. Needs exposures that the board triggers
    /// [default: off].
    #[arg(long, value_name = "FIRST[,SECOND]", value_parser = parse_light)]
    light: Option<LightLevels>,
}

impl CameraArguments {
    pub fn settings(&self) -> Result<CameraSettings> {
        Ok(CameraSettings {
            address: self.camera.parse()?,
            exposure: Micros(self.exposure_us),
            image_wait: Duration::from_secs(self.image_wait_s),
            settings: self.set.clone(),
            light: self.light,
        })
    }
}
