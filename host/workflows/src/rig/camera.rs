//! Cameras that users can name for a rig.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    str::FromStr,
    time::Duration,
};

use farnear_capture::{
    camera::{Camera, CommandCamera, FolderCamera, Range, Setting, SimCamera, command::CommandLine},
    expose::{CaptureError, check_exposure},
    record::Circumstances,
};
use farnear_depth::psf::Psf;
use farnear_protocol::{
    Micros,
    message::{LIGHT_LEVEL_MAX, LightLevels},
};

use super::{Rig, RigAddress};
use crate::{
    MADE_BY, clock,
    context::Context,
    error::{Result, WorkflowError},
    optics::GivenOptics,
};

#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum CameraAddress {
    #[default]
    Emulated,
    /// Camera of a running `farnear-sim`, HOST:PORT.
    Endpoint(String),
    Folder(PathBuf),
    /// A program that writes images to its standard output.
    Command(CommandLine),
    V4l(PathBuf),
    /// A GigE Vision or USB3 Vision camera by its identification; the first one if empty.
    Genicam(String),
}

/// Addresses other than `sim`.
pub const OTHERS: &str = "HOST:PORT, folder:DIR, command:\"PROGRAM ...\", v4l:DEVICE or genicam:ID";

impl FromStr for CameraAddress {
    type Err = WorkflowError;

    fn from_str(text: &str) -> Result<Self> {
        if text == "sim" {
            return Ok(Self::Emulated);
        }
        match text.split_once(':') {
            Some(("folder", folder)) => Ok(Self::Folder(folder.into())),
            Some(("command", line)) => {
                let wrong = |reason| WorkflowError::parameter("camera", text, reason);
                line.parse().map(Self::Command).map_err(wrong)
            }
            Some(("v4l", device)) => Ok(Self::V4l(device.into())),
            Some(("genicam", id)) => Ok(Self::Genicam(id.into())),
            Some(_) => Ok(Self::Endpoint(text.into())),
            None if text == "genicam" => Ok(Self::Genicam(String::new())),
            None => Err(WorkflowError::parameter("camera", text, format!("expected sim, {OTHERS}"))),
        }
    }
}

impl CameraAddress {
    /// Opens the camera; `None` for the emulated rig's camera.
    pub fn open(&self) -> Result<Option<Box<dyn Camera + Send>>> {
        Ok(Some(match self {
            Self::Emulated => return Ok(None),
            Self::Endpoint(address) => Box::new(SimCamera::connect(address)?),
            Self::Folder(folder) => Box::new(FolderCamera::watch(folder)?),
            Self::Command(line) => Box::new(CommandCamera::start(line)?),
            Self::V4l(device) => open_v4l(device)?,
            Self::Genicam(id) => open_genicam(id)?,
        }))
    }
}

#[cfg(all(feature = "v4l2", target_os = "linux"))]
fn open_v4l(device: &Path) -> Result<Box<dyn Camera + Send>> {
    Ok(Box::new(farnear_capture::camera::V4lCamera::open(device)?))
}

#[cfg(not(all(feature = "v4l2", target_os = "linux")))]
fn open_v4l(device: &Path) -> Result<Box<dyn Camera + Send>> {
    farnear_capture::camera::v4l::check_path(device)?; // errors of the device first
    Err(not_built("v4l", device.display(), "v4l2"))
}

#[cfg(feature = "genicam")]
fn open_genicam(id: &str) -> Result<Box<dyn Camera + Send>> {
    Ok(Box::new(farnear_capture::camera::GenicamCamera::open(id)?))
}

#[cfg(not(feature = "genicam"))]
fn open_genicam(id: &str) -> Result<Box<dyn Camera + Send>> {
    Err(not_built("genicam", id, "genicam"))
}

#[cfg(not(all(feature = "v4l2", feature = "genicam", target_os = "linux")))]
fn not_built(kind: &str, address: impl std::fmt::Display, feature: &str) -> WorkflowError {
    let expected = format!(
        "this program was built without it; build farnear with the cargo feature `{feature}` (docs/cameras.md)"
    );
    WorkflowError::parameter("camera", format!("{kind}:{address}"), expected)
}

#[derive(Clone, PartialEq, Debug)]
pub struct CameraSettings {
    pub address: CameraAddress,
    pub exposure: Micros,
    pub image_wait: Duration,
    /// Controls to set before any motion, in this order; never the exposure.
    pub settings: Vec<Setting>,
    pub light: Option<LightLevels>,
}

/// Parses `FIRST` or `FIRST,SECOND`, percent.
pub fn parse_light(text: &str) -> std::result::Result<LightLevels, String> {
    let percent = |part: &str| part.trim().parse().map_err(|_| not_a_brightness(part));
    let (first, second) = text.split_once(',').unwrap_or((text, "0"));
    light_of_percent([percent(first)?, percent(second)?])
}

fn not_a_brightness(given: impl std::fmt::Display) -> String {
    format!("{given} is not a brightness: expected 0 to 100 %")
}

/// Brightness of both outputs.
pub fn light_of_percent([first, second]: [f64; 2]) -> std::result::Result<LightLevels, String> {
    let level = |percent: f64| match (0.0..=100.0).contains(&percent) {
        true => Ok((percent / 100.0 * f64::from(LIGHT_LEVEL_MAX)).round() as u16),
        false => Err(not_a_brightness(percent)),
    };
    Ok(LightLevels { first: level(first)?, second: level(second)? })
}

impl Default for CameraSettings {
    fn default() -> Self {
        Self {
            address: CameraAddress::Emulated,
            exposure: Micros(5_000),
            image_wait: Duration::from_secs(30),
            settings: Vec::new(),
            light: None,
        }
    }
}

/// A camera opened before the rig, so that a missing camera is reported before any motion.
pub struct EarlyCamera {
    camera: Option<Box<dyn Camera>>,
    settings: CameraSettings,
}

const OF_THE_EMULATED_RIG: &str = "it belongs to the emulated rig";

impl CameraSettings {
    pub fn connect(
        &self,
        address: &RigAddress,
        optics: Option<&GivenOptics>,
        context: &Context<'_>,
    ) -> Result<EquippedRig> {
        self.open_early(address, context)?.connect(address, optics, context)
    }

    /// The light of the request; without one that of the optics file.
    pub fn light_with(&self, optics: Option<&GivenOptics>) -> Option<LightLevels> {
        match self.light {
            Some(levels) => Some(levels).filter(|levels| *levels != LightLevels::OFF),
            None => optics.and_then(|optics| optics.light),
        }
    }

    /// Values of `settings` by their names, for a capture's record.
    pub(super) fn recorded_settings(&self) -> BTreeMap<String, String> {
        self.settings.iter().map(|setting| (setting.name().to_owned(), setting.value())).collect()
    }

    pub fn open_early(&self, rig: &RigAddress, context: &Context<'_>) -> Result<EarlyCamera> {
        let other = match (&self.address, rig) {
            (CameraAddress::Emulated, RigAddress::Open(open)) if !open.is_emulated() => {
                Some(open.name().to_owned())
            }
            (CameraAddress::Emulated, RigAddress::Attached) => Some("the board".into()),
            (CameraAddress::Emulated, RigAddress::Port(port)) => Some(port.to_string()),
            _ => None,
        };
        if let Some(rig) = other {
            let expected =
                format!("{OF_THE_EMULATED_RIG} and is the default; name the camera of {rig}: {OTHERS}");
            return Err(WorkflowError::parameter("camera", "sim", expected));
        }
        if let Some(exposure) = self.settings.iter().find(|setting| matches!(setting, Setting::ExposureUs(_)))
        {
            let expected =
                "the board's pulse is the exposure: set it where the other exposures are set".to_string();
            return Err(WorkflowError::parameter("exposure_us", exposure.value(), expected));
        }
        let opened = match &self.address {
            // A silent address takes seconds.
            CameraAddress::Endpoint(_) | CameraAddress::Genicam(_) => {
                let address = self.address.clone();
                context.cancel.watch("opening the camera", move || address.open())??
            }
            // A program would outlive a thread that is left behind.
            other => other.open()?,
        };
        let camera = opened.map(|camera| self.set_up(camera)).transpose()?;
        Ok(EarlyCamera { camera, settings: self.clone() })
    }

    fn set_up(&self, mut camera: Box<dyn Camera>) -> Result<Box<dyn Camera>> {
        self.settings.iter().try_for_each(|setting| camera.set(setting))?;
        Ok(camera)
    }
}

impl EarlyCamera {
    pub(super) fn kind(&self) -> &'static str {
        self.camera.as_ref().map_or("sim", |camera| camera.kind())
    }

    /// Connects to the rig; without a named camera, uses the emulated rig's.
    pub fn connect(
        self,
        address: &RigAddress,
        optics: Option<&GivenOptics>,
        context: &Context<'_>,
    ) -> Result<EquippedRig> {
        let mut rig = Rig::connect(address, optics.map(GivenOptics::for_emulation), context)?;
        rig.client.set_light(self.settings.light_with(optics));
        let camera = match (self.camera, &rig.emulation) {
            (Some(camera), _) => camera,
            (None, Some((simulator, _))) => {
                self.settings.set_up(Box::new(SimCamera::connect(simulator.camera())?))?
            }
            (None, None) => return Err(WorkflowError::parameter("camera", "sim", OF_THE_EMULATED_RIG)),
        };
        let mut equipped = EquippedRig { camera, rig };
        equipped.check_exposure(self.settings.exposure)?;
        Ok(equipped)
    }

    /// As [`Self::connect`], with a second camera behind a half mirror; by default the emulated rig's second.
    pub(super) fn connect_both(
        self,
        second: Self,
        address: &RigAddress,
        optics: Option<&GivenOptics>,
        context: &Context<'_>,
    ) -> Result<(EquippedRig, Box<dyn Camera>)> {
        let equipped = self.connect(address, optics, context)?;
        if let Some(camera) = second.camera {
            return Ok((equipped, camera));
        }
        let simulator = equipped.rig.emulation.as_ref().map(|(simulator, _)| simulator);
        let address = simulator.and_then(|simulator| simulator.second_camera()).ok_or_else(|| {
            WorkflowError::parameter("second-camera", "sim", "this emulated rig was started without one")
        })?;
        let camera = second.settings.set_up(Box::new(SimCamera::connect(address)?))?;
        Ok((equipped, camera))
    }
}

/// A connected rig with its camera. The camera is dropped before the rig.
pub struct EquippedRig {
    pub camera: Box<dyn Camera>,
    pub rig: Rig,
}

impl EquippedRig {
    fn check_exposure(&mut self, exposure: Micros) -> Result<()> {
        check_exposure(&self.rig.client, exposure).map_err(CaptureError::from)?;
        let asked = f64::from(exposure.0);
        // Unreadable camera settings are reported when the camera is armed.
        for control in self.camera.controls().unwrap_or_default() {
            if control.name == "exposure_us"
                && matches!(control.range, Range::Number { .. })
                && !control.range.has(asked)
            {
                let expected = format!("the camera allows {}", control.range);
                return Err(WorkflowError::parameter("exposure_us", asked, expected));
            }
        }
        Ok(())
    }

    /// Metadata of a capture. `psf` and `optics` are those used for the capture, as far as known.
    pub fn circumstances(&self, psf: Psf, optics: toml::Table) -> Circumstances {
        Circumstances {
            made_by: MADE_BY.into(),
            time: (!self.rig.client.hello().emulated).then(clock::now_rfc3339).flatten(),
            camera: self.camera.kind(),
            simulation: self.rig.emulation.as_ref().map(|(_, scenery)| scenery.decided(psf)),
            optics,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    #[test]
    fn cancelling_ends_the_wait_for_a_camera_that_does_not_answer() {
        // No host has this address (RFC 5737).
        let address = "192.0.2.1:9".parse().unwrap();
        let context = Context::unattended();
        context.cancel.cancel();
        let begin = Instant::now();
        let settings = CameraSettings { address, ..CameraSettings::default() };
        assert!(settings.open_early(&RigAddress::Attached, &context).is_err());
        assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    }
}
