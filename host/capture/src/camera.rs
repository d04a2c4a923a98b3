//! Cameras: one image per trigger of the board. One file per kind.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};
use ndarray::{Array2, Zip};

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

#[derive(Clone, PartialEq, Debug)]
pub struct Image {
    /// (height, width); values in 0..2^bits.
    pub pixels: Array2<u16>,
    /// Significant bits, 8 to 16.
    pub bits: u8,
    /// Variance of a pixel by lossy compression, as a part of full scale squared; 0 without.
    pub coding_variance: f64,
}

impl Image {
    /// An image without lossy compression.
    pub fn new(pixels: Array2<u16>, bits: u8) -> Self {
        Self { pixels, bits, coding_variance: 0.0 }
    }

    /// This image less one of the same size without the lamp; saturated pixels stay white.
    pub(crate) fn without(&self, dark: &Self) -> Self {
        let white = ((1u32 << self.bits.min(16)) - 1) as u16;
        let pixels = Zip::from(&self.pixels).and(&dark.pixels).map_collect(|lit, dark| match *lit >= white {
            true => white,
            false => lit.saturating_sub(*dark),
        });
        Self { pixels, bits: self.bits, coding_variance: self.coding_variance + dark.coding_variance }
    }

    /// Grey values from 0 to 1.
    pub fn grey(&self) -> Array2<f32> {
        let largest = f32::from(((1u32 << self.bits.min(16)) - 1) as u16);
        self.pixels.mapv(|code| f32::from(code) / largest)
    }

    pub fn codes(&self) -> Array2<f32> {
        self.pixels.mapv(f32::from)
    }

    /// Histogram over all codes; larger values count as the largest code.
    pub fn counts(&self) -> Vec<u32> {
        let largest = (1usize << self.bits.clamp(1, 16)) - 1;
        let mut counts = vec![0; largest + 1];
        for code in &self.pixels {
            counts[usize::from(*code).min(largest)] += 1;
        }
        counts
    }

    /// Upper eight bits, row by row.
    pub fn eight_bits(&self) -> Vec<u8> {
        let (bits, pixels) = (self.bits, self.pixels.iter());
        if bits >= 8 {
            pixels.map(|code| (code >> (bits - 8)).min(255) as u8).collect()
        } else {
            pixels.map(|code| (code << (8 - bits)).min(255) as u8).collect()
        }
    }
}

/// A picture for live view.
#[derive(Clone, PartialEq, Debug)]
pub struct Frame {
    pub image: Image,
    pub stamp: Stamp,
}

pub trait Camera {
    /// Kind of camera for a capture's record, without address or path.
    fn kind(&self) -> &'static str;

    /// Prepares for exposures of this kind and drops earlier images. Free-running ones keep the exposure.
    fn arm(&mut self, mode: TriggerMode, exposure: Micros) -> Result<(), CameraError>;

    /// Whether it exposes for the time of [`Self::arm`] and not for the length of the trigger pulse.
    fn sets_exposure(&mut self, _: TriggerMode) -> bool {
        false
    }

    /// Whether the frames before a frame tell that one between them is missing.
    fn pairs_by_frames_before(&self) -> bool {
        false
    }

    /// Software trigger of one exposure.
    fn trigger(&mut self, trigger_number: u32, exposure: Micros) -> Result<(), CameraError>;

    /// Waits at most `wait` for the image of this exposure. Call in order; may be repeated after [`CameraError::Late`].
    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError>;

    /// Called per reported exposure before its image is fetched; `received` is the report's arrival.
    fn reported(&mut self, _shot: &ShotRecord, _received: Instant) {}

    /// Time without a picture that ends a program.
    fn quiet_time(&self) -> Duration {
        Duration::ZERO
    }

    /// Waits at most `wait` after a program's last image, called until [`Self::quiet_time`] has passed: a surplus
    /// picture makes the pairing of the whole program uncertain.
    fn finish(&mut self, _wait: Duration) -> Result<(), CameraError> {
        Ok(())
    }

    /// Adjustable settings with ranges, and readable values.
    fn controls(&mut self) -> Result<Vec<Control>, CameraError> {
        Ok(Vec::new())
    }

    /// Changes a setting permanently; values out of range are rejected, not clamped.
    fn set(&mut self, setting: &Setting) -> Result<(), CameraError> {
        let expected = format!("a camera of the kind `{}` has nothing to set", self.kind());
        Err(CameraError::Setting { name: setting.name(), value: setting.value(), expected })
    }

    /// Starts a live view without a board until the camera is armed.
    fn watch(&mut self) -> Result<(), CameraError> {
        let reason = "this kind gives pictures to a rig only".into();
        Err(CameraError::Unusable { camera: self.kind().into(), reason })
    }

    /// The newest unread picture since [`Self::watch`]; `None` after `wait`. Fails if no more can come.
    fn newest(&mut self, _wait: Duration) -> Result<Option<Frame>, CameraError> {
        Ok(None)
    }
}

#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    #[error("no camera at {address}: {reason}; does a simulator run, and is this its camera's address?")]
    Connect { address: String, reason: String },
    #[error("the camera at {address} went away: {reason}")]
    Gone { address: String, reason: String },
    #[error("the camera at {address} is in use by another program; end that program first")]
    InUse { address: String },
    #[error("the camera at {address} sends no images: {reason}")]
    Nonsense { address: String, reason: String },
    #[error("a camera of the kind `{camera}` cannot be triggered by {mode}; use hardware triggers")]
    Trigger { camera: &'static str, mode: &'static str },
    #[error("the camera gave no image of exposure {trigger_number} within {waited:?} ({camera})")]
    Late { camera: String, trigger_number: u32, waited: Duration },
    #[error("the camera skipped exposure {wanted}: it sent the image of exposure {came}")]
    Skipped { wanted: u32, came: u32 },
    #[error(
        "the image of exposure {trigger_number} has {width}x{height} pixels of {bits} bits, expected {first_width}x{first_height} of \
         {first_bits} as before: let nothing change the camera's size or format during a program"
    )]
    Reformatted {
        trigger_number: u32,
        width: usize,
        height: usize,
        bits: u8,
        first_width: usize,
        first_height: usize,
        first_bits: u8,
    },
    #[error("cannot look into the camera's folder {}: {source}", folder.display())]
    Folder { folder: PathBuf, source: std::io::Error },
    #[error("{} cannot be used: {reason}", path.display())]
    File { path: PathBuf, reason: String },
    #[error(
        "the picture for exposure {wanted} cannot be distinguished from others ({camera}): {reason}; does the camera take one picture \
         for each trigger, and is its strobe wired to the board?"
    )]
    Mispaired { camera: String, wanted: u32, reason: String },
    #[error(
        "the camera gave a picture more than it was triggered ({camera}), so none is certain to belong to its exposure; it \
         must take one picture for each trigger and not run freely{}",
        ffmpeg_hint(camera)
    )]
    Surplus { camera: String },
    #[error(
        "the next picture arrived {} ms before exposure {wanted} began ({camera}), so it belongs to an earlier one: the camera gave \
         a picture more than it was triggered; it must take one picture for each trigger and not run freely{}",
        early.as_millis(),
        ffmpeg_hint(camera)
    )]
    Stale { camera: String, wanted: u32, early: Duration },
    #[error(
        "the pictures for exposures {earlier} and {wanted} are identical ({camera}): one of them is a copy; each trigger must \
         give one picture of its own{}",
        ffmpeg_hint(camera)
    )]
    Doubled { camera: String, earlier: u32, wanted: u32 },
    #[error(
        "{} was taken before the picture of the exposure before it: pictures arrive in another order than they were taken; \
         let them be transferred one after the other",
        path.display()
    )]
    Reordered { path: PathBuf },
    #[error(
        "{} was overwritten: each picture needs its own file name (gphoto2: --filename 'image-%n.jpg')",
        path.display()
    )]
    Overwritten { path: PathBuf },
    #[error("frame {frame} of {camera} came incomplete: {reason}")]
    Incomplete { camera: String, frame: u64, reason: String },
    #[error("{camera} cannot be used as a camera: {reason}")]
    Unusable { camera: String, reason: String },
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
        let image = |bits, code| Image::new(array![[code]], bits);
        assert_eq!(image(8, 200).eight_bits(), [200]);
        assert_eq!(image(12, 0xabc).eight_bits(), [0xab]);
        assert_eq!(image(4, 0xf).eight_bits(), [0xf0]);
        assert_eq!(image(12, 4095).grey(), array![[1.0]]);
        assert_eq!(image(12, 4095).codes(), array![[4095.0]]);
    }

    #[test]
    fn pixels_are_counted_by_code() {
        let counts = Image::new(array![[0, 3], [3, 4000]], 8).counts();
        assert_eq!(counts.len(), 256);
        assert_eq!([counts[0], counts[1], counts[3], counts[255]], [1, 0, 2, 1]);
    }
}
