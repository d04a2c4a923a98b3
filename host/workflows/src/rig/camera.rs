//! The camera that goes with a rig, as users name it.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
    time::Duration,
};

use farnear_capture::{
    camera::{Camera, FolderCamera, SimCamera},
    record::Circumstances,
};
use farnear_depth::psf::Psf;
use farnear_protocol::Micros;

use super::{Rig, RigAddress};
use crate::{
    MADE_BY, clock,
    context::Context,
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

/// What is wrong with this camera at another rig.
const OF_THE_EMULATED_RIG: &str = "it belongs to the emulated rig";

impl CameraSettings {
    /// Opens the camera and connects to the rig, in the order in which the least is done in vain. Everything that takes
    /// pictures begins with this, after its folder.
    ///
    /// # Errors
    /// [`WorkflowError::Parameter`], [`WorkflowError::Camera`], [`WorkflowError::Simulator`], [`WorkflowError::Client`].
    pub fn connect(
        &self,
        address: &RigAddress,
        optics: Option<(&Path, Psf)>,
        context: &Context<'_>,
    ) -> Result<EquippedRig> {
        self.open_early(address)?.connect(address, optics, context)
    }

    /// Opens the camera, unless it is the one that comes with the emulated rig.
    ///
    /// # Errors
    /// [`WorkflowError::Parameter`] for the emulated rig's camera with another rig, [`WorkflowError::Camera`].
    pub fn open_early(&self, rig: &RigAddress) -> Result<EarlyCamera> {
        let camera: Option<Box<dyn Camera>> = match (&self.address, rig) {
            (CameraAddress::Emulated, RigAddress::Emulated(_)) => None,
            (CameraAddress::Emulated, RigAddress::Open(open)) if open.is_emulated() => None,
            (CameraAddress::Emulated, RigAddress::Open(open)) => {
                return Err(WorkflowError::parameter(
                    "camera",
                    "sim",
                    format!("{OF_THE_EMULATED_RIG}; {} needs HOST:PORT or folder:DIR", open.name()),
                ));
            }
            (CameraAddress::Emulated, RigAddress::Port(port)) => {
                return Err(WorkflowError::parameter(
                    "camera",
                    "sim",
                    format!("{OF_THE_EMULATED_RIG}; {port} needs HOST:PORT or folder:DIR"),
                ));
            }
            (CameraAddress::Folder(folder), _) => Some(Box::new(FolderCamera::watch(folder)?)),
            (CameraAddress::Endpoint(address), _) => Some(Box::new(SimCamera::connect(address)?)),
        };
        Ok(EarlyCamera(camera))
    }
}

impl EarlyCamera {
    /// Connects to the rig; without a camera of its own, to the emulated rig's.
    ///
    /// # Errors
    /// [`WorkflowError::Simulator`], [`WorkflowError::Client`], [`WorkflowError::Camera`].
    pub fn connect(
        self,
        address: &RigAddress,
        optics: Option<(&Path, Psf)>,
        context: &Context<'_>,
    ) -> Result<EquippedRig> {
        let rig = Rig::connect(address, optics, context)?;
        let camera = match (self.0, &rig.emulation) {
            (Some(camera), _) => camera,
            (None, Some((simulator, _))) => Box::new(SimCamera::connect(simulator.camera())?),
            (None, None) => return Err(WorkflowError::parameter("camera", "sim", OF_THE_EMULATED_RIG)),
        };
        Ok(EquippedRig { camera, rig })
    }
}

/// A connected rig with its camera, which goes before the rig does.
pub struct EquippedRig {
    /// Where images come from.
    pub camera: Box<dyn Camera>,
    /// The rig.
    pub rig: Rig,
}

impl EquippedRig {
    /// What a capture's record says beside what was measured. `psf` and `optics` are those that were captured with, as
    /// far as they are known.
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
