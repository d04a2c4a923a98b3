//! Masks of the person who moves in a video, one picture per frame.
//!
//! A background model learns static pixels; moving regions are cleaned and the person chosen. Memory does not grow with the
//! video's length but for the index.

use std::{path::PathBuf, time::Instant};

use farnear_files::{
    masks,
    staging::Staging,
    video::{Pixels, Video, VideoError, VideoFrame},
};
use farnear_shadow::detectors::{Detector, Images, Method};
use farnear_silhouettes::background::Label;
use farnear_silhouettes::mask::{
    Mask,
    extractor::{Extracted, Extractor, ExtractorSettings, Learning},
    subject::Flag,
};
use ndarray::{Array3, Axis};
use serde::Serialize;

use super::{SilhouettesError, cut_out, frame_of};
use crate::{context::Context, error::Result, figures::rounded};

/// From one sign of progress to the next, frames.
const PROGRESS_FRAMES: usize = 50;
/// Work that is cancelled.
const DURING: &str = "making masks";

/// What masks are made of, how, and where to.
#[derive(Clone, Debug)]
pub struct VideoSettings {
    /// A folder of pictures, a Y4M file, or what an installed ffmpeg reads.
    pub video: PathBuf,
    /// The new folder of masks.
    pub out: PathBuf,
    /// Watch the whole video once to learn the background before masks are made.
    pub learn_first: bool,
    /// Frames at the beginning that only teach the background.
    pub learning_frames: u32,
    /// Frames that the background model remembers.
    pub history_frames: u32,
    /// Which frames and pixels teach the background.
    pub learning: Learning,
    /// What becomes of the person's shadow.
    pub shadow: ShadowTreatment,
    /// Masks of 100x100 pixels with the person centred, instead of full frames.
    pub centred: bool,
    /// A new folder for the background model's labels before cleaning: 0 background, 127 shadow, 255 foreground.
    pub labels: Option<PathBuf>,
    /// Average colour to grey first.
    pub grey: bool,
}

/// What becomes of a person's shadow.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum ShadowTreatment {
    /// The background model tells it by colour; in grey it stays.
    #[default]
    ByModel,
    /// Count pixels that are only darker than the background as the person.
    Keep,
    /// An image-based detector takes it off; colour only.
    Detector(Method),
}

/// How many frames were what.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct VideoFigures {
    pub frames: usize,
    /// Frames with a usable silhouette.
    pub silhouettes: usize,
    /// Frames that only taught the background.
    pub learning: usize,
    pub empty: usize,
    /// Frames with several people.
    pub several_people: usize,
    /// Frames whose person is cut by the picture's edge.
    pub cut_by_edge: usize,
    /// Frames in which most of the picture changed.
    pub scene_changed: usize,
    /// Frames with a person who has stopped moving.
    pub stopped_moving: usize,
    /// Frames whose person is in several pieces.
    pub fragments: usize,
    /// Times that the light of the whole scene changed suddenly.
    pub changes_of_light: usize,
    pub seconds: f64,
    /// Frames over that time.
    pub frames_per_second: f64,
    /// What a user should know about how the video was read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

impl VideoFigures {
    fn count(&mut self, flags: &[Flag]) {
        self.frames += 1;
        self.silhouettes += usize::from(!flags.iter().any(|flag| flag.spoils()));
        for flag in flags {
            match flag {
                Flag::Learning => self.learning += 1,
                Flag::Empty => self.empty += 1,
                Flag::SeveralPeople { .. } => self.several_people += 1,
                Flag::CutByEdge => self.cut_by_edge += 1,
                Flag::SceneChanged { .. } => self.scene_changed += 1,
                Flag::StoppedMoving => self.stopped_moving += 1,
                Flag::Fragments { .. } => self.fragments += 1,
            }
        }
    }
}

/// `silhouettes.toml`: one entry per frame.
#[derive(Debug, Default, Serialize)]
struct Index {
    frame: Vec<Entry>,
}

#[derive(Debug, Serialize)]
struct Entry {
    file: String,
    flags: Vec<String>,
    /// First row, first column, one past the last row and column, pixels of the full frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    top_left_bottom_right: Option<[usize; 4]>,
}

/// Makes a mask of every frame (255 = person) and `silhouettes.toml`, which flags doubtful frames.
///
/// # Errors
/// Where the video cannot be read, its frames differ, or the masks cannot be written; then the new folder is not there.
pub fn extract(settings: &VideoSettings, context: &Context<'_>) -> Result<VideoFigures> {
    let out = Staging::new_folder(&settings.out)?;
    let labels = settings.labels.as_deref().map(Staging::new_folder).transpose()?;
    let mut video = Video::open(&settings.video)?;
    let remarks: Vec<String> =
        video.remark.iter().map(|remark| format!("{}: {remark}", settings.video.display())).collect();
    remarks.iter().for_each(|remark| context.progress.warn(remark));
    let none = || VideoError::NoFrames { path: settings.video.clone() };
    let first = prepared(video.next().ok_or_else(none)??, settings.grey);
    let mut work = Work::new(&first, settings)?;
    let start = Instant::now();
    if settings.learn_first {
        for frame in Video::open(&settings.video)? {
            context.cancel.check("learning the background")?;
            work.extractor.learn(frame_of(&prepared(frame?, settings.grey).pixels))?;
        }
    }
    let mut figures = VideoFigures { remarks, ..VideoFigures::default() };
    let mut index = Index::default();
    for frame in std::iter::once(Ok(first)).chain(video) {
        context.cancel.check(DURING)?;
        let frame = prepared(frame?, settings.grey);
        let (found, mask) = work.mask(&frame)?;
        figures.count(&found.subject.flags);
        index.frame.push(keep(&frame.name, &found, &mask, settings.centred, &out, labels.as_ref())?);
        if figures.frames.is_multiple_of(PROGRESS_FRAMES) {
            context.progress.advance("frames", figures.frames, None);
        }
    }
    figures.changes_of_light = work.extractor.changes_of_light();
    let seconds = start.elapsed().as_secs_f64();
    figures.seconds = rounded(seconds, 3);
    figures.frames_per_second = rounded(figures.frames as f64 / seconds, 1);
    out.write("silhouettes.toml", toml::to_string(&index)?.as_bytes())?;
    if let Some(labels) = labels {
        labels.finish()?;
    }
    out.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(figures)
}

/// Writes a frame's mask and, where asked for, the labels it was made of.
fn keep(
    name: &str,
    found: &Extracted,
    mask: &Mask,
    centred: bool,
    out: &Staging,
    labels: Option<&Staging>,
) -> Result<Entry> {
    let file = format!("{name}.png");
    let png = if centred { masks::png(&cut_out(mask))? } else { masks::png(mask)? };
    out.write(&file, &png)?;
    if let Some(labels) = labels {
        let levels = masks::encoded(&found.labels, |label| match label {
            Label::Background => 0,
            Label::Shadow => 127,
            Label::Foreground => 255,
        })?;
        labels.write(&file, &levels)?;
    }
    Ok(Entry {
        file,
        flags: found.subject.flags.iter().map(Flag::to_string).collect(),
        top_left_bottom_right: found.subject.bounds.map(|b| [b.top, b.left, b.bottom, b.right]),
    })
}

/// Grey where asked for: the mean of the three channels.
fn prepared(frame: VideoFrame, grey: bool) -> VideoFrame {
    match frame.pixels {
        Pixels::Rgb(rgb) if grey => {
            let mean = rgb.map_axis(Axis(2), |pixel| {
                let sum: u16 = pixel.iter().map(|&level| u16::from(level)).sum();
                ((sum + 1) / 3) as u8
            });
            VideoFrame { name: frame.name, pixels: Pixels::Grey(mean) }
        }
        pixels => VideoFrame { name: frame.name, pixels },
    }
}

/// Extraction and, where chosen, a shadow detector.
struct Work {
    extractor: Extractor,
    detector: Option<Detector>,
}

impl Work {
    fn new(first: &VideoFrame, asked: &VideoSettings) -> Result<Self> {
        let frame = frame_of(&first.pixels);
        let mut settings = ExtractorSettings::for_frame(frame);
        settings.learning_frames = asked.learning_frames;
        settings.background.history_frames = asked.history_frames;
        settings.learning = asked.learning;
        if asked.shadow != ShadowTreatment::ByModel {
            settings.background.shadow = None;
        }
        let detector = match (asked.shadow, &first.pixels) {
            (ShadowTreatment::Detector(method), Pixels::Grey(_)) => {
                return Err(SilhouettesError::NeedsColour { method }.into());
            }
            (ShadowTreatment::Detector(method), Pixels::Rgb(_)) => Some(Detector::new(method)),
            _ => None,
        };
        Ok(Self { extractor: Extractor::like(frame, settings)?, detector })
    }

    /// The frame's extraction and the mask to write.
    fn mask(&mut self, frame: &VideoFrame) -> Result<(Extracted, Mask)> {
        let found = self.extractor.extract(frame_of(&frame.pixels))?;
        let mut mask = found.subject.mask.clone();
        if let (Some(detector), Pixels::Rgb(pixels)) = (&mut self.detector, &frame.pixels) {
            let background: Array3<u8> = self.extractor.background().background();
            let images = Images::new(pixels.view(), background.view(), mask.view())?;
            let shadow = detector.detect(&images);
            mask.zip_mut_with(&shadow, |set, &shadow| *set &= !shadow);
        }
        Ok((found, mask))
    }
}
