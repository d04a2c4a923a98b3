//! Cameras: what gives an image for a trigger of the board. One file per kind.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};
use ndarray::Array2;

pub mod command;
pub mod controls;
pub mod folder;
#[cfg(feature = "genicam")]
pub mod genicam;
pub mod pairing;
pub mod pixels;
pub mod sim;
pub mod v4l;

pub use command::CommandCamera;
pub use controls::{Control, Range, Setting};
pub use folder::FolderCamera;
#[cfg(feature = "genicam")]
pub use genicam::GenicamCamera;
pub use pairing::Stamp;
pub use sim::SimCamera;
#[cfg(all(feature = "v4l2", target_os = "linux"))]
pub use v4l::V4lCamera;

/// One exposure as the camera delivers it.
#[derive(Clone, PartialEq, Debug)]
pub struct Image {
    /// Shape (height, width); values lie in 0..2^bits.
    pub pixels: Array2<u16>,
    /// Bits that carry the picture, 8 to 16.
    pub bits: u8,
}

impl Image {
    /// Grey values from 0 to 1.
    pub fn grey(&self) -> Array2<f32> {
        let largest = f32::from(((1u32 << self.bits.min(16)) - 1) as u16);
        self.pixels.mapv(|code| f32::from(code) / largest)
    }

    /// The codes as they came, as floats.
    pub fn codes(&self) -> Array2<f32> {
        self.pixels.mapv(f32::from)
    }

    /// How many pixels have each code, from 0 to the largest that the bits carry; codes above it count as it.
    pub fn counts(&self) -> Vec<u32> {
        let largest = (1usize << self.bits.clamp(1, 16)) - 1;
        let mut counts = vec![0; largest + 1];
        for code in &self.pixels {
            counts[usize::from(*code).min(largest)] += 1;
        }
        counts
    }

    /// The upper eight bits of each pixel, row by row.
    pub fn eight_bits(&self) -> Vec<u8> {
        let (bits, pixels) = (self.bits, self.pixels.iter());
        if bits >= 8 {
            pixels.map(|code| (code >> (bits - 8)).min(255) as u8).collect()
        } else {
            pixels.map(|code| (code << (8 - bits)).min(255) as u8).collect()
        }
    }
}

/// A picture as it came, to look at.
#[derive(Clone, PartialEq, Debug)]
pub struct Frame {
    pub image: Image,
    /// What the camera says of it.
    pub stamp: Stamp,
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

    /// Called for each exposure that the board reports, before its image is fetched; `received` is when the report arrived.
    fn reported(&mut self, _shot: &ShotRecord, _received: Instant) {}

    /// How long no further picture may come after the last image of a program.
    fn quiet_time(&self) -> Duration {
        Duration::ZERO
    }

    /// Called after the last image of a program, repeatedly until [`Self::quiet_time`] has passed: waits at most `wait` for a
    /// picture that no exposure accounts for. With such a picture, no picture of the program is certain to be paired correctly.
    fn finish(&mut self, _wait: Duration) -> Result<(), CameraError> {
        Ok(())
    }

    /// What can be set, with its range, and what can be read.
    fn controls(&mut self) -> Result<Vec<Control>, CameraError> {
        Ok(Vec::new())
    }

    /// Sets something, until it is set again; what is out of range is refused, never brought into it.
    fn set(&mut self, setting: &Setting) -> Result<(), CameraError> {
        let expected = format!("a camera of the kind `{}` has nothing to set", self.kind());
        Err(CameraError::Setting { name: setting.name(), value: setting.value(), expected })
    }

    /// Takes pictures without a board from now on, as many as the camera can, until it is armed.
    fn watch(&mut self) -> Result<(), CameraError> {
        let reason = "this kind gives pictures to a rig only".into();
        Err(CameraError::Unusable { camera: self.kind().into(), reason })
    }

    /// The newest picture since [`Self::watch`] that was not given yet, waiting at most `wait` for it; `None` when time is up.
    /// An error when nothing more can come.
    fn newest(&mut self, _wait: Duration) -> Result<Option<Frame>, CameraError> {
        Ok(None)
    }
}

/// A camera did not deliver.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// No camera answers at the address.
    #[error("no camera at {address}: {reason}; does a simulator run, and is this its camera's address?")]
    Connect {
        address: String,
        /// What the system says.
        reason: String,
    },
    /// The connection broke off.
    #[error("the camera at {address} went away: {reason}")]
    Gone {
        address: String,
        /// What the system says.
        reason: String,
    },
    /// Another program has the camera.
    #[error("the camera at {address} is in use by another program; end that program first")]
    InUse { address: String },
    /// What came is no image.
    #[error("the camera at {address} sends no images: {reason}")]
    Nonsense { address: String, reason: String },
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
    Late { camera: String, trigger_number: u32, waited: Duration },
    /// The image of this exposure was passed over.
    #[error("the camera skipped exposure {wanted}: it sent the image of exposure {came}")]
    Skipped {
        /// Which exposure was due.
        wanted: u32,
        came: u32,
    },
    /// The folder cannot be looked into.
    #[error("cannot look into the camera's folder {}: {source}", folder.display())]
    Folder {
        folder: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// An image file that appeared cannot be used.
    #[error("{} cannot be used: {reason}", path.display())]
    File { path: PathBuf, reason: String },
    /// What a frame says of itself contradicts what the board says of the exposure.
    #[error(
        "the picture for exposure {wanted} cannot be told from others ({camera}): {reason}; does the camera take one picture \
         for each trigger, and is its strobe wired to the board?"
    )]
    Mispaired {
        camera: String,
        /// Which exposure was due.
        wanted: u32,
        reason: String,
    },
    /// More pictures than triggers.
    #[error(
        "the camera gave a picture more than it was triggered ({camera}), so none is certain to belong to its exposure; it \
         must take one picture for each trigger and not run freely{}",
        ffmpeg_hint(camera)
    )]
    Surplus { camera: String },
    /// A picture that arrived before its exposure can have begun.
    #[error(
        "the next picture arrived {} ms before exposure {wanted} began ({camera}), so it belongs to an earlier one: the camera gave \
         a picture more than it was triggered; it must take one picture for each trigger and not run freely{}",
        early.as_millis(),
        ffmpeg_hint(camera)
    )]
    Stale {
        camera: String,
        /// Exposure that was due.
        wanted: u32,
        /// At least so much too early.
        early: Duration,
    },
    /// Two exposures with the same pixels.
    #[error(
        "the pictures for exposures {earlier} and {wanted} are identical ({camera}): one of them is a copy; each trigger must \
         give one picture of its own{}",
        ffmpeg_hint(camera)
    )]
    Doubled {
        camera: String,
        /// Exposure that has the same picture.
        earlier: u32,
        /// Exposure that was due.
        wanted: u32,
    },
    /// A picture that is older than one that was already used.
    #[error(
        "{} was taken before the picture of the exposure before it: pictures arrive in another order than they were taken; \
         let them be transferred one after the other",
        path.display()
    )]
    Reordered { path: PathBuf },
    /// A picture file that was written again.
    #[error(
        "{} was overwritten: each picture needs a file name of its own (gphoto2: --filename 'image-%n.jpg')",
        path.display()
    )]
    Overwritten { path: PathBuf },
    /// A frame that did not come whole.
    #[error("frame {frame} of {camera} came incomplete: {reason}")]
    Incomplete {
        camera: String,
        /// Its number, as the camera counts.
        frame: u64,
        reason: String,
    },
    /// A device or program that cannot be used.
    #[error("{camera} cannot be used as a camera: {reason}")]
    Unusable {
        /// The device, or the program.
        camera: String,
        reason: String,
    },
    /// A value that cannot be set.
    #[error("{name} {value}: {expected}")]
    Setting { name: &'static str, value: String, expected: String },
}

/// ffmpeg repeats frames by default to keep a constant rate.
fn ffmpeg_hint(camera: &str) -> &'static str {
    match camera.contains("ffmpeg") {
        true => "; ffmpeg repeats frames to keep its rate: add -fps_mode passthrough before the output",
        false => "",
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::Image;

    #[test]
    fn pixels_keep_their_upper_bits() {
        let image = |bits, code| Image { pixels: array![[code]], bits };
        assert_eq!(image(8, 200).eight_bits(), [200]);
        assert_eq!(image(12, 0xabc).eight_bits(), [0xab]);
        assert_eq!(image(4, 0xf).eight_bits(), [0xf0]);
        assert_eq!(image(12, 4095).grey(), array![[1.0]]);
        assert_eq!(image(12, 4095).codes(), array![[4095.0]]);
    }

    #[test]
    fn pixels_are_counted_by_code() {
        let counts = Image { pixels: array![[0, 3], [3, 4000]], bits: 8 }.counts();
        assert_eq!(counts.len(), 256);
        assert_eq!([counts[0], counts[1], counts[3], counts[255]], [1, 0, 2, 1]);
    }
}
