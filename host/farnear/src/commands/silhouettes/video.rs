//! `farnear silhouettes video`: masks of the person who moves in a video, one PNG per frame.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_shadow::detectors::Method;
use farnear_silhouettes::mask::extractor::Learning;
use farnear_workflows::silhouettes::video::{self, ShadowTreatment, VideoSettings};

use crate::{report, terminal};

/// Masks of the person who moves in a video, one PNG per frame (255 = person).
///
/// A background model learns static pixels; moving regions are cleaned and the person chosen. Frames without a person, with
/// several people, of a changed scene, with a person in pieces or standing still, or from before the background is known are flagged in `silhouettes.toml` next to
/// the masks; without a recognisable person the mask is empty.
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
    /// Which frames and pixels teach the background: outside-people (all frames, but not people), until:FRAMES (the same, then
    /// nothing), always (who stands becomes background within seconds) or never (only --learn-first or --learning-frames).
    #[arg(long, value_name = "WHEN", default_value = "outside-people")]
    learning: Learning,
    /// Count pixels that are only darker than the background as the person, not as shadow.
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

/// Runs the command.
///
/// # Errors
/// See [`video::extract`].
pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    let shadow = match arguments.shadow_detector {
        Some(method) => ShadowTreatment::Detector(method),
        None if arguments.keep_shadow => ShadowTreatment::Keep,
        None => ShadowTreatment::ByModel,
    };
    let settings = VideoSettings {
        video: arguments.video,
        out: arguments.out,
        learn_first: arguments.learn_first,
        learning_frames: arguments.learning_frames,
        history_frames: arguments.history_frames,
        learning: arguments.learning,
        shadow,
        centred: arguments.centred,
        labels: arguments.labels,
        grey: arguments.grey,
    };
    report::print(&video::extract(&settings, &terminal::counting(json)?)?, json)
}
