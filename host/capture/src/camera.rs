//! Cameras: what gives an image for a trigger of the board. One file per kind.

use std::{path::PathBuf, time::Duration};

use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};
use ndarray::Array2;

pub mod folder;
pub mod sim;

pub use folder::FolderCamera;
pub use sim::SimCamera;

/// One exposure as the camera delivers it.
#[derive(Clone, PartialEq, Debug)]
pub struct Image {
    /// Shape (height, width); values lie in 0..2^bits.
    pub pixels: Array2<u16>,
    /// Bits that carry the picture, 8 to 16.
    pub bits: u8,
}

/// Something that takes an image at each trigger.
pub trait Camera {
    /// What it is, for a capture's record: the same for each camera of the kind, without address or path.
    fn kind(&self) -> &'static str;

    /// Makes ready for exposures that come about like this: images from before do not count. A camera that runs freely
    /// takes pictures of this exposure until it is armed again.
    fn arm(&mut self, mode: TriggerMode, exposure: Micros) -> Result<(), CameraError>;

    /// Triggers the camera by its own means, once, now.
    fn trigger(&mut self, trigger_number: u32, exposure: Micros) -> Result<(), CameraError>;

    /// The image of this exposure, waiting at most `wait` for it. Called for each exposure, in order; after
    /// [`CameraError::Late`] it may be called for the same exposure again.
    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError>;
}

/// A camera did not deliver.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// No camera answers at the address.
    #[error("no camera at {address}: {reason}; does a simulator run, and is this its camera's address?")]
    Connect {
        /// The address.
        address: String,
        /// What the system says.
        reason: String,
    },
    /// The connection broke off.
    #[error("the camera at {address} went away: {reason}")]
    Gone {
        /// The address.
        address: String,
        /// What the system says.
        reason: String,
    },
    /// Another program has the camera.
    #[error("the camera at {address} is in use by another program; end that program first")]
    InUse {
        /// The address.
        address: String,
    },
    /// What came is no image.
    #[error("the camera at {address} sends no images: {reason}")]
    Nonsense {
        /// The address.
        address: String,
        /// What is wrong.
        reason: String,
    },
    /// The camera knows no such trigger.
    #[error("a camera of the kind `{camera}` cannot be triggered by {mode}; use hardware triggers")]
    Trigger {
        /// The camera's kind.
        camera: &'static str,
        /// How it was to be triggered.
        mode: &'static str,
    },
    /// Nothing came in time.
    #[error("the camera gave no image of exposure {trigger_number} within {waited:?} ({camera})")]
    Late {
        /// The camera.
        camera: String,
        /// Which exposure.
        trigger_number: u32,
        /// How long was waited.
        waited: Duration,
    },
    /// The image of this exposure was passed over.
    #[error("the camera skipped exposure {wanted}: it sent the image of exposure {came}")]
    Skipped {
        /// Which exposure was due.
        wanted: u32,
        /// Which one came.
        came: u32,
    },
    /// The folder cannot be looked into.
    #[error("cannot look into the camera's folder {}: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// An image file that appeared cannot be used.
    #[error("{} cannot be used: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}
