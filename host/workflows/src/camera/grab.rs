//! Images of a free-running camera, stored in a folder with a record.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use farnear_capture::camera::{CameraError, Frame, pairing::counted};
use farnear_files::{
    image_file::{encode_png, encode_tiff},
    staging::Staging,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CameraChoice, ControlFigures, controls_of};
use crate::{
    MADE_BY, clock,
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
};

pub const GRAB_FILE: &str = "grab.toml";
const SLICE: Duration = Duration::from_millis(200);
/// Longest wait, s: a longer one may be beyond the end of the clock.
const A_DAY_S: u64 = 86_400;

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum PictureFormat {
    /// Values of more than 8 bits are shifted up to 16.
    #[default]
    Png,
    /// Values stay as the camera gave them.
    Tiff,
}

/// Keep pictures of a camera that runs freely. The folder appears when everything is in it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear camera grab --camera v4l:/dev/video0 --frames 10 --out pictures/"
    )
)]
#[serde(default)]
pub struct GrabRequest {
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub camera: CameraChoice,
    /// How many pictures.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().frames))]
    pub frames: usize,
    /// How they are written.
    #[cfg_attr(feature = "clap", arg(long, value_enum, default_value = "png"))]
    pub format: PictureFormat,
    /// Longest wait for a picture in seconds.
    #[cfg_attr(feature = "clap", arg(long, value_name = "S", default_value_t = Self::default().image_wait_s))]
    pub image_wait_s: u64,
    /// The new folder.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Default for GrabRequest {
    fn default() -> Self {
        Self {
            camera: CameraChoice::default(),
            frames: 1,
            format: PictureFormat::default(),
            image_wait_s: 10,
            out: PathBuf::new(),
        }
    }
}

impl Request for GrabRequest {
    const NAME: &'static str = "camera grab";
    const REQUIRED: &'static [&'static str] = &["camera", "out"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("out", PathKind::OutputFolder)];
    type Figures = GrabFigures;

    fn check(&self) -> Result<()> {
        if self.frames == 0 {
            return Err(WorkflowError::parameter("frames", 0, "it takes no pictures, expected 1 or more"));
        }
        Ok(())
    }

    fn run(&self, context: &Context<'_>) -> Result<GrabFigures> {
        grab(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct GrabFigures {
    pub frames: usize,
    pub width: usize,
    pub height: usize,
    /// Significant bits of a pixel.
    pub bits: u8,
    /// Images counted by the camera (if it counts) but not stored: lost, or too fast for this computer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passed_over: Option<u64>,
}

#[derive(Serialize)]
struct GrabRecord {
    made_by: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<String>,
    camera: &'static str,
    control: Vec<ControlFigures>,
    frame: Vec<FrameRecord>,
}

#[derive(Serialize)]
struct FrameRecord {
    image: String,
    width: usize,
    height: usize,
    bits: u8,
    /// The camera's frame counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<u64>,
    /// By the camera's clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_us: Option<u64>,
}

/// Captures images. The folder appears when it is complete.
pub fn grab(request: &GrabRequest, context: &Context<'_>) -> Result<GrabFigures> {
    request.check()?;
    let wait = Duration::from_secs(request.image_wait_s.min(A_DAY_S));
    let staged = Staging::new_folder(&request.out)?;
    let mut camera = request.camera.open()?;
    let mut record = GrabRecord {
        made_by: MADE_BY,
        time: clock::now_rfc3339(),
        camera: camera.kind(),
        control: controls_of(camera.as_mut())?,
        frame: Vec::new(),
    };
    camera.watch()?;
    for number in 0..request.frames {
        let until = Instant::now() + wait;
        let frame = loop {
            context.cancel.check("taking pictures")?;
            if let Some(frame) = camera.newest(SLICE.min(wait))? {
                break frame;
            }
            if Instant::now() >= until {
                let (camera, waited) = (camera.kind().to_owned(), wait);
                return Err(CameraError::Late { camera, trigger_number: number as u32, waited }.into());
            }
        };
        record.frame.push(write(&staged, number, &frame, request.format)?);
        context.progress.advance("pictures", number + 1, Some(request.frames));
    }
    staged.write(GRAB_FILE, toml::to_string(&record)?.as_bytes())?;
    staged.finish()?;
    context.info(&format!("wrote {}", request.out.display()));
    figures(&record).ok_or_else(|| WorkflowError::parameter("frames", 0, "expected 1 or more"))
}

fn write(staged: &Staging, number: usize, frame: &Frame, format: PictureFormat) -> Result<FrameRecord> {
    let (pixels, bits) = (frame.image.pixels.view(), frame.image.bits);
    let (bytes, ending) = match format {
        PictureFormat::Png => (encode_png(pixels, bits)?, "png"),
        PictureFormat::Tiff => (encode_tiff(pixels, bits)?, "tiff"),
    };
    let image = format!("frame-{number:04}.{ending}");
    staged.write(&image, &bytes)?;
    let (height, width) = pixels.dim();
    let time_us = frame.stamp.time.and_then(|time| u64::try_from(time.as_micros()).ok());
    Ok(FrameRecord { image, width, height, bits, count: frame.stamp.count, time_us })
}

fn figures(record: &GrabRecord) -> Option<GrabFigures> {
    let last = record.frame.last()?;
    // From frame to frame, because a short count wraps.
    let advance = |two: &[FrameRecord]| u64::try_from(counted(two[0].count?, two[1].count?)).ok();
    let counted = record.frame.windows(2).map(advance).sum::<Option<u64>>();
    Some(GrabFigures {
        frames: record.frame.len(),
        width: last.width,
        height: last.height,
        bits: last.bits,
        passed_over: counted.and_then(|counted| counted.checked_sub(record.frame.len() as u64 - 1)),
    })
}
