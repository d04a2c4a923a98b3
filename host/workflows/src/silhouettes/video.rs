//! `farnear silhouettes video`: masks of the person who moves in a video, one PNG per frame.

use std::{io::IsTerminal, path::PathBuf, time::Instant};

use anyhow::{Result, bail, ensure};
use clap::Args;
use farnear_activity::{
    background::Label,
    mask::{
        Mask,
        centre::{SIDE_PX, centred},
        extractor::{Extracted, Extractor, ExtractorSettings},
        subject::Flag,
    },
    shadow_detectors::{Detector, Images, Method},
};
use farnear_capture::aside::Aside;
use ndarray::{Array3, Axis};
use serde::Serialize;

use crate::{
    masks, report,
    video::{Pixels, Video, VideoFrame},
};

/// Masks of the person who moves in a video, one PNG per frame (255 = person).
///
/// A background model learns what stands still; what moves is cleaned and the person chosen. Frames with nobody, with
/// several people, of a changed scene or from before the background is known are flagged in `silhouettes.toml` beside
/// the masks; where nobody can be told the mask is empty.
#[derive(Args)]
#[command(after_help = "Example: farnear silhouettes video walk.y4m --out masks/ --learn-first")]
pub struct Arguments {
    /// A folder of pictures, a .y4m file, or any video if ffmpeg is installed.
    video: PathBuf,
    /// Folder for the masks; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Watch the whole video once to learn the background before the masks are made; no frame is lost to learning.
    #[arg(long)]
    learn_first: bool,
    /// Frames at the beginning that only teach the background.
    #[arg(long, default_value_t = 10)]
    learning_frames: u32,
    /// Frames that the background model remembers.
    #[arg(long, default_value_t = 500)]
    history_frames: u32,
    /// Count what is merely darker than the background as the person, not as shadow.
    #[arg(long)]
    keep_shadow: bool,
    /// Take shadow off with one of the image-based detectors instead of the background model's own test (colour only):
    /// chromaticity, physical, geometry, small-region-texture or large-region-texture.
    #[arg(long, value_name = "METHOD", conflicts_with = "keep_shadow")]
    shadow_detector: Option<Method>,
    /// Write masks of 100x100 pixels with the person centred, instead of full frames.
    #[arg(long)]
    centred: bool,
    /// Also write the background model's own labels here, before cleaning: 0 background, 127 shadow, 255 foreground.
    #[arg(long, value_name = "DIR")]
    labels: Option<PathBuf>,
    /// Average colour to grey first.
    #[arg(long)]
    grey: bool,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// The figures.
#[derive(Debug, Default, Serialize)]
struct Figures {
    frames: usize,
    silhouettes: usize,
    learning: usize,
    empty: usize,
    several_people: usize,
    cut_by_edge: usize,
    scene_changed: usize,
    seconds: f64,
    frames_per_second: f64,
}

impl Figures {
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

/// Runs the command.
///
/// # Errors
/// Where the video cannot be read, its frames differ, or the masks cannot be written; then `--out` is left as it was.
pub fn run(arguments: &Arguments) -> Result<()> {
    let out = Aside::new_folder(&arguments.out)?;
    let labels = arguments.labels.as_deref().map(Aside::new_folder).transpose()?;
    let mut video = Video::open(&arguments.video)?;
    let Some(first) = video.next() else { bail!("{}: no frame in this video", arguments.video.display()) };
    let first = prepared(first?, arguments.grey);
    let mut work = Work::new(&first, arguments)?;
    let start = Instant::now();
    if arguments.learn_first {
        for frame in Video::open(&arguments.video)? {
            work.extractor.learn(prepared(frame?, arguments.grey).pixels.frame())?;
        }
    }
    let mut figures = Figures::default();
    let mut index = Index::default();
    let progress = std::io::stderr().is_terminal() && !arguments.json;
    for frame in std::iter::once(Ok(first)).chain(video) {
        let frame = prepared(frame?, arguments.grey);
        let (found, mask) = work.mask(&frame)?;
        figures.count(&found.subject.flags);
        let file = format!("{}.png", frame.name);
        let picture = if arguments.centred {
            centred(mask.view(), SIDE_PX).unwrap_or_else(|| Mask::from_elem((SIDE_PX, SIDE_PX), false))
        } else {
            mask
        };
        out.write(&file, &masks::png(&picture)?)?;
        if let Some(labels) = &labels {
            let levels = masks::encoded(&found.labels, |label| match label {
                Label::Background => 0,
                Label::Shadow => 127,
                Label::Foreground => 255,
            })?;
            labels.write(&file, &levels)?;
        }
        index.frame.push(Entry {
            file,
            flags: found.subject.flags.iter().map(Flag::to_string).collect(),
            top_left_bottom_right: found.subject.bounds.map(|b| [b.top, b.left, b.bottom, b.right]),
        });
        if progress && figures.frames % 50 == 0 {
            eprint!("\r{} frames", figures.frames);
        }
    }
    if progress && figures.frames >= 50 {
        eprintln!();
    }
    let seconds = start.elapsed().as_secs_f64();
    figures.seconds = report::rounded(seconds, 3);
    figures.frames_per_second = report::rounded(figures.frames as f64 / seconds, 1);
    out.write("silhouettes.toml", toml::to_string(&index)?.as_bytes())?;
    if let Some(labels) = labels {
        labels.finish()?;
    }
    out.finish()?;
    eprintln!("wrote {}", arguments.out.display());
    report::print(&figures, arguments.json)
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
    fn new(first: &VideoFrame, arguments: &Arguments) -> Result<Self> {
        let frame = first.pixels.frame();
        let mut settings = ExtractorSettings::for_frame(frame);
        settings.learning_frames = arguments.learning_frames;
        settings.background.history_frames = arguments.history_frames;
        if arguments.keep_shadow || arguments.shadow_detector.is_some() {
            settings.background.shadow = None;
        }
        if let Some(method) = arguments.shadow_detector {
            ensure!(
                matches!(first.pixels, Pixels::Rgb(_)),
                "--shadow-detector {} compares colours, but the video is grey",
                method.name()
            );
        }
        Ok(Self {
            extractor: Extractor::like(frame, settings)?,
            detector: arguments.shadow_detector.map(Detector::new),
        })
    }

    /// The frame's extraction and the mask to write.
    fn mask(&mut self, frame: &VideoFrame) -> Result<(Extracted, Mask)> {
        let found = self.extractor.extract(frame.pixels.frame())?;
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
