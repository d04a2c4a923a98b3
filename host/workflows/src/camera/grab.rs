//! Images of a free-running camera, stored in a folder with a record.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use farnear_capture::camera::{CameraError, Frame};
use farnear_files::{
    image_file::{encode_png, encode_tiff},
    staging::Staging,
};
use serde::Serialize;

use super::{CameraChoice, ControlFigures, controls_of};
use crate::{
    MADE_BY, clock,
    context::Context,
    error::{Result, WorkflowError},
};

pub const GRAB_FILE: &str = "grab.toml";
const SLICE: Duration = Duration::from_millis(200);

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PictureFormat {
    /// Values of more than 8 bits are shifted to 16.
    Png,
    Tiff,
}

#[derive(Clone, PartialEq, Debug)]
pub struct GrabSettings {
    pub camera: CameraChoice,
    pub frames: usize,
    pub format: PictureFormat,
    pub wait: Duration,
    pub out: PathBuf,
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
pub fn grab(settings: &GrabSettings, context: &Context<'_>) -> Result<GrabFigures> {
    if settings.frames == 0 {
        return Err(WorkflowError::parameter("frames", 0, "it takes no pictures, expected 1 or more"));
    }
    let staged = Staging::new_folder(&settings.out)?;
    let mut camera = settings.camera.open()?;
    let mut record = GrabRecord {
        made_by: MADE_BY,
        time: clock::now_rfc3339(),
        camera: camera.kind(),
        control: controls_of(camera.as_mut())?,
        frame: Vec::new(),
    };
    camera.watch()?;
    for number in 0..settings.frames {
        let until = Instant::now() + settings.wait;
        let frame = loop {
            context.cancel.check("taking pictures")?;
            if let Some(frame) = camera.newest(SLICE.min(settings.wait))? {
                break frame;
            }
            if Instant::now() >= until {
                let (camera, waited) = (camera.kind().to_owned(), settings.wait);
                return Err(CameraError::Late { camera, trigger_number: number as u32, waited }.into());
            }
        };
        record.frame.push(write(&staged, number, &frame, settings.format)?);
        context.progress.advance("pictures", number + 1, Some(settings.frames));
    }
    staged.write(GRAB_FILE, toml::to_string(&record)?.as_bytes())?;
    staged.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
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
    let (first, last) = (record.frame.first()?, record.frame.last()?);
    let counted = first.count.zip(last.count).map(|(first, last)| last.wrapping_sub(first));
    Some(GrabFigures {
        frames: record.frame.len(),
        width: last.width,
        height: last.height,
        bits: last.bits,
        passed_over: counted.and_then(|counted| counted.checked_sub(record.frame.len() as u64 - 1)),
    })
}
