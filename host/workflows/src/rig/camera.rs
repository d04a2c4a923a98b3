//! The camera that goes with a rig, as users name it.

use std::{path::PathBuf, str::FromStr, time::Duration};

use farnear_capture::{
    camera::{Camera, FolderCamera, SimCamera},
    record::Circumstances,
};
use farnear_depth::psf::Psf;
use farnear_protocol::Micros;

use super::{Rig, RigAddress};
use crate::{
    clock,
    error::{Result, WorkflowError},
};

/// Which camera.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum CameraAddress {
    /// The emulated rig's own.
    #[default]
    Emulated,
    /// That of a `farnear-sim` which somebody else started, HOST:PORT.
    Endpoint(String),
    /// A folder in which images appear.
    Folder(PathBuf),
}

impl FromStr for CameraAddress {
    type Err = WorkflowError;

    fn from_str(text: &str) -> Result<Self> {
        if text == "sim" {
            return Ok(Self::Emulated);
        }
        if let Some(folder) = text.strip_prefix("folder:") {
            return Ok(Self::Folder(folder.into()));
        }
        if !text.contains(':') {
            return Err(WorkflowError::parameter("camera", text, "expected sim, HOST:PORT or folder:DIR"));
        }
        Ok(Self::Endpoint(text.into()))
    }
}

/// A camera and how it exposes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CameraSettings {
    /// Which.
    pub address: CameraAddress,
    /// Length of an exposure.
    pub exposure: Micros,
    /// Longest wait for an image.
    pub image_wait: Duration,
}

/// A camera that does not hang on the emulated rig, opened before the rig: one that is not there is known before anything
/// moves.
pub struct EarlyCamera(Option<Box<dyn Camera>>);

impl CameraSettings {
    /// Opens the camera, unless it is the one that comes with the emulated rig.
    ///
    /// # Errors
    /// [`WorkflowError::Parameter`] for the emulated rig's camera with another rig, [`WorkflowError::Camera`].
    pub fn open_early(&self, rig: &RigAddress) -> Result<EarlyCamera> {
        let camera: Option<Box<dyn Camera>> = match (&self.address, rig) {
            (CameraAddress::Emulated, RigAddress::Emulated(_)) => None,
            (CameraAddress::Emulated, RigAddress::Port(port)) => {
                return Err(WorkflowError::parameter(
                    "camera",
                    "sim",
                    format!("it belongs to the emulated rig; with {port} give HOST:PORT or folder:DIR"),
                ));
            }
            (CameraAddress::Folder(folder), _) => Some(Box::new(FolderCamera::watch(folder)?)),
            (CameraAddress::Endpoint(address), _) => Some(Box::new(SimCamera::connect(address)?)),
        };
        Ok(EarlyCamera(camera))
    }
}

impl EarlyCamera {
    /// The camera of a connected rig: this one, else the emulated rig's.
    ///
    /// # Errors
    /// [`WorkflowError::Camera`].
    pub fn of_rig(self, rig: &Rig) -> Result<Box<dyn Camera>> {
        match (self.0, &rig.emulation) {
            (Some(camera), _) => Ok(camera),
            (None, Some((simulator, _))) => Ok(Box::new(SimCamera::connect(simulator.camera())?)),
            (None, None) => Err(WorkflowError::parameter("camera", "sim", "it belongs to the emulated rig")),
        }
    }
}

/// What a capture's record says beside what was measured. `made_by` is the program and its version.
pub fn circumstances(
    rig: &Rig,
    camera: &dyn Camera,
    psf: Psf,
    optics: toml::Table,
    made_by: &str,
) -> Circumstances {
    Circumstances {
        made_by: made_by.into(),
        time: (!rig.client.hello().emulated).then(clock::now_rfc3339).flatten(),
        camera: camera.kind(),
        simulation: rig.emulation.as_ref().map(|(_, scenery)| scenery.decided(psf)),
        optics,
    }
}
