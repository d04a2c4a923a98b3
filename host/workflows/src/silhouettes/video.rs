//! Masks of the person who moves in a video, one per frame. A background model learns static pixels; moving regions are
//! cleaned and the person chosen. Memory does not grow with the video's length, except for the index.

use std::{path::PathBuf, time::Instant};

use farnear_files::{
    masks,
    staging::Staging,
    video::{Pixels, Video, VideoError, VideoFrame},
};
use farnear_shadow::detectors::{Detector, Images, Method};
use farnear_silhouettes::background::{Frame, Label};
use farnear_silhouettes::mask::{
    extractor::{Extracted, Extractor, ExtractorSettings, Learning},
    subject::Flag,
};
use ndarray::{Array3, Axis};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{SilhouettesError, cut_out, frame_of};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    request::{PathKind, Request},
};

/// Interval between progress reports.
const PROGRESS_FRAMES: usize = 50;
const DURING: &str = "making masks";

/// Masks of the person who moves in a video, one PNG per frame (255 = person).
///
/// A background model learns static pixels; moving regions are cleaned and the person chosen. Frames without a person, with
/// several people, of a changed scene, with a person in pieces or standing still, or from before the background is known are
/// flagged in `silhouettes.toml` next to the masks; without a recognisable person the mask is empty.
#[serde_as]
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear silhouettes video walk.y4m --out masks/ --learn-first")
)]
#[serde(default)]
pub struct SilhouettesVideoRequest {
    /// A folder of pictures, a .y4m file, or any video if ffmpeg is installed.
    pub video: PathBuf,
    /// Folder for the masks; must not exist or be empty.
    #[cfg_attr(feature = "clap", arg(long))]
    pub out: PathBuf,
    /// Watch the whole video once to learn the background before the masks are made; no frame is lost to learning.
    #[cfg_attr(feature = "clap", arg(long))]
    pub learn_first: bool,
    /// Frames at the beginning that only teach the background.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().learning_frames))]
    pub learning_frames: u32,
    /// Frames that the background model remembers.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().history_frames))]
    pub history_frames: u32,
    /// Which frames and pixels teach the background: outside-people (all frames, but not people), until:FRAMES (the same, then
    /// nothing), always (a person who stops becomes background within seconds) or never (only --learn-first or --learning-frames).
    #[cfg_attr(feature = "clap", arg(long, value_name = "WHEN", default_value_t = Self::default().learning))]
    #[serde_as(as = "DisplayFromStr")]
    pub learning: Learning,
    /// Count pixels that are only darker than the background as the person, not as shadow.
    #[cfg_attr(feature = "clap", arg(long))]
    pub keep_shadow: bool,
    /// Remove shadow with an image-based detector instead of the background model's own test (colour only): chromaticity, physical,
    /// geometry, small-region-texture or large-region-texture.
    #[cfg_attr(feature = "clap", arg(long, value_name = "METHOD", conflicts_with = "keep_shadow"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub shadow_detector: Option<Method>,
    /// Write masks of 100x100 pixels with the person centred, instead of full frames.
    #[cfg_attr(feature = "clap", arg(long))]
    pub centred: bool,
    /// Also write the background model's own labels here, before cleaning: 0 background, 127 shadow, 255 foreground.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub labels: Option<PathBuf>,
    /// Average colour to grey first.
    #[cfg_attr(feature = "clap", arg(long))]
    pub grey: bool,
}

impl Default for SilhouettesVideoRequest {
    fn default() -> Self {
        Self {
            video: PathBuf::new(),
            out: PathBuf::new(),
            learn_first: false,
            learning_frames: 10,
            history_frames: 500,
            learning: Learning::default(),
            keep_shadow: false,
            shadow_detector: None,
            centred: false,
            labels: None,
            grey: false,
        }
    }
}

impl Request for SilhouettesVideoRequest {
    const NAME: &'static str = "silhouettes video";
    const REQUIRED: &'static [&'static str] = &["video", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("video", PathKind::Input), ("out", PathKind::OutputFolder), ("labels", PathKind::OutputFolder)];
    type Figures = VideoFigures;

    fn check(&self) -> Result<()> {
        match self.shadow_detector.filter(|_| self.keep_shadow) {
            None => Ok(()),
            Some(detector) => {
                let expected = "keep_shadow leaves the shadow in place: expected one of the two";
                Err(WorkflowError::parameter("shadow_detector", detector, expected))
            }
        }
    }

    fn run(&self, context: &Context<'_>) -> Result<VideoFigures> {
        extract(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct VideoFigures {
    pub frames: usize,
    /// Frames with a usable silhouette.
    pub silhouettes: usize,
    /// Frames used only to learn the background.
    pub learning: usize,
    pub empty: usize,
    pub several_people: usize,
    /// Frames with a person cut by the picture's edge.
    pub cut_by_edge: usize,
    /// Frames in which most of the picture changed.
    pub scene_changed: usize,
    /// Frames with a person who stopped moving.
    pub stopped_moving: usize,
    pub fragments: usize,
    /// Sudden changes of the whole scene's light.
    pub changes_of_light: usize,
    pub seconds: f64,
    pub frames_per_second: f64,
    /// Notes on how the video was read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

impl VideoFigures {
    /// Why no frame has a usable silhouette.
    fn without_people(&self) -> Option<String> {
        let reason = if self.learning == self.frames {
            "all of them were used to learn the background: lower learning-frames, or give a longer video"
        } else if self.learning + self.empty == self.frames {
            "nothing of a person's size moves in them, and people who are motionless throughout are background: record the \
             place without people, too"
        } else {
            "silhouettes.toml has the reason of each"
        };
        (self.silhouettes == 0)
            .then(|| format!("none of {} frames has a usable silhouette; {reason}", self.frames))
    }

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
#[derive(Debug, Serialize)]
struct Index {
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_hz: Option<f64>,
    frame: Vec<Entry>,
}

#[derive(Debug, Serialize)]
struct Entry {
    file: String,
    flags: Vec<String>,
    /// First row, first column, one past the last row and column, in the full frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    top_left_bottom_right: Option<[usize; 4]>,
}

/// Masks every frame (255 = person) and writes `silhouettes.toml`, which flags doubtful frames; nothing on failure.
pub fn extract(settings: &SilhouettesVideoRequest, context: &Context<'_>) -> Result<VideoFigures> {
    let out = Staging::new_folder(&settings.out)?;
    let labels = settings.labels.as_deref().map(Staging::new_folder).transpose()?;
    let mut video = Video::open(&settings.video)?;
    let mut remarks = Vec::new();
    context.warn(video.take_remarks(), &mut remarks);
    let none = || VideoError::NoFrames { path: settings.video.clone() };
    let first = prepared(video.next().ok_or_else(none)??, settings.grey);
    let mut work = Work::new(&first, settings)?;
    if first.pixels.kind().colour && !frame_of(&first.pixels).has_colour() {
        let kept =
            format!("{}: its frames are grey: shadow is kept with the people", settings.video.display());
        context.warn([kept], &mut remarks);
    }
    let start = Instant::now();
    if settings.learn_first {
        for frame in Video::open(&settings.video)? {
            context.cancel.check("learning the background")?;
            work.extractor.learn(frame_of(&prepared(frame?, settings.grey).pixels))?;
        }
        work.extractor.rewind(frame_of(&first.pixels));
    }
    let mut figures = VideoFigures::default();
    let mut index = Index { rate_hz: video.rate_hz(), frame: Vec::new() };
    for frame in std::iter::once(Ok(first)).chain(video.by_ref()) {
        context.cancel.check(DURING)?;
        let frame = prepared(frame?, settings.grey);
        let found = work.extract(&frame)?;
        figures.count(&found.subject.flags);
        index.frame.push(keep(&frame.name, &found, settings.centred, &out, labels.as_ref())?);
        if figures.frames.is_multiple_of(PROGRESS_FRAMES) {
            context.progress.advance("frames", figures.frames, None);
        }
    }
    context.warn(video.take_remarks(), &mut remarks);
    context.warn(figures.without_people(), &mut remarks);
    let doubts = work.extractor.doubts().into_iter();
    context.warn(doubts.map(|doubt| format!("{}: {doubt}", settings.video.display())), &mut remarks);
    figures.remarks = remarks;
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

/// Writes a frame's mask and, if requested, the labels it was made from.
fn keep(
    name: &str,
    found: &Extracted,
    centred: bool,
    out: &Staging,
    labels: Option<&Staging>,
) -> Result<Entry> {
    let file = format!("{name}.png");
    let mask = &found.subject.mask;
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

/// Grey if requested: the mean of the three channels.
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

struct Work {
    extractor: Extractor,
    detector: Option<Detector>,
}

impl Work {
    fn new(first: &VideoFrame, asked: &SilhouettesVideoRequest) -> Result<Self> {
        let frame = frame_of(&first.pixels);
        let mut settings = ExtractorSettings::for_frame(frame);
        settings.learning_frames = asked.learning_frames;
        settings.learning = asked.learning;
        settings.background.history_frames = asked.history_frames;
        if asked.keep_shadow || asked.shadow_detector.is_some() {
            settings.background.shadow = None;
        }
        if let Some(method) = asked.shadow_detector.filter(|_| !frame.has_colour()) {
            return Err(SilhouettesError::NeedsColour { method }.into());
        }
        let detector = asked.shadow_detector.map(Detector::new);
        Ok(Self { extractor: Extractor::like(frame, settings)?, detector })
    }

    fn extract(&mut self, frame: &VideoFrame) -> Result<Extracted> {
        let detector = &mut self.detector;
        self.extractor.extract_without(frame_of(&frame.pixels), |frame, model, mask| {
            if let (Some(detector), Frame::Rgb(pixels)) = (detector, frame) {
                let background: Array3<u8> = model.background();
                let images = Images::new(pixels.view(), background.view(), mask.view())?;
                let shadow = detector.detect(&images);
                mask.zip_mut_with(&shadow, |set, &shadow| *set &= !shadow);
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 25 frames of a person in seven pieces, after 15 frames without one.
    fn in_pieces() -> Vec<u8> {
        let mut video = b"YUV4MPEG2 W160 H120 F50:1 Cmono XCOLORRANGE=FULL\n".to_vec();
        for frame in 0..40 {
            video.extend(b"FRAME\n");
            for (row, column) in
                (0..120_usize).flat_map(|row| (0..160_usize).map(move |column| (row, column)))
            {
                let noise = ((frame * 7919 + row * 104_729 + column * 1_299_709) % 7) as u8;
                let left = 20 + 2 * frame;
                let is_person = frame >= 15
                    && (27..90).contains(&row)
                    && row % 9 < 6
                    && (left..left + 20).contains(&column);
                video.push(if is_person { 220 - noise } else { 80 + 20 * ((column / 9) % 2) as u8 + noise });
            }
        }
        video
    }

    #[test]
    fn the_frame_rate_is_written_and_people_in_pieces_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let (video, out) = (folder.path().join("walk.y4m"), folder.path().join("masks"));
        std::fs::write(&video, in_pieces()).expect("written");
        let request =
            SilhouettesVideoRequest { video, out: out.clone(), ..SilhouettesVideoRequest::default() };
        let figures = extract(&request, &Context::unattended()).expect("masks");
        assert_eq!((figures.silhouettes, figures.fragments), (25, 25));
        let remarks = figures.remarks.join("\n");
        assert!(remarks.contains("walk.y4m: the person is in 7.0 pieces on average"), "{remarks}");
        let index = std::fs::read_to_string(out.join("silhouettes.toml")).expect("an index");
        let index: toml::Table = index.parse().expect("an index");
        assert_eq!(index["rate_hz"].as_float(), Some(50.0));
        assert_eq!(index["frame"].as_array().map(Vec::len), Some(40));
    }
}
