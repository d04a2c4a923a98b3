//! Masks of a person from video, motion capture, public joint sets or synthetic people, and their passages.

pub mod markers;
pub mod passages;
pub mod performances;
pub mod skeletons;
pub mod synthetic;
pub mod video;

use std::{ops::RangeInclusive, path::PathBuf};

use farnear_files::video::Pixels;
use farnear_shadow::detectors::Method;
use farnear_silhouettes::background::Frame;
use farnear_silhouettes::mask::{
    Mask,
    centre::{SIDE_PX, centred},
};
use farnear_silhouettes::readers::{recording::RecordingError, skeletons::SkeletonError};
use farnear_silhouettes::silhouette::template::TemplateError;

pub(crate) const VIEWS: RangeInclusive<usize> = 1..=72;
pub(crate) const MM_PER_PX: RangeInclusive<f64> = 0.1..=1000.0;

#[derive(Debug, thiserror::Error)]
pub enum SilhouettesError {
    #[error("{}: {source}", path.display())]
    Recording { path: PathBuf, source: RecordingError },
    #[error("{}: {source}", path.display())]
    Skeletons { path: PathBuf, source: SkeletonError },
    #[error("the template {name}: {source}")]
    Template { name: String, source: TemplateError },
    #[error("{}: {source}{}", path.display(), fitting(*.fits))]
    Unfit { path: PathBuf, source: TemplateError, fits: Option<&'static str> },
    #[error("{}: the recording holds no frame", path.display())]
    NoFrames { path: PathBuf },
    #[error(
        "{}: no .json file in the folder; expected keypoints as JSON, a file per frame (YOLO's .txt labels are not read)",
        path.display()
    )]
    NoKeypointFiles { path: PathBuf },
    #[error("{}: no frame has a visible marker, so there is nothing to draw", path.display())]
    NothingVisible { path: PathBuf },
    #[error(
        "{what} reaches from {low_mm:.0} to {high_mm:.0} mm, which is not a picture at {mm_per_px} mm per pixel; the \
         unit may be wrong"
    )]
    TooLarge { what: String, low_mm: f64, high_mm: f64, mm_per_px: f64 },
    #[error("{}: no person in {least} successive frames{}", path.display(), leaping(.leap.as_ref()))]
    NoPassage {
        path: PathBuf,
        least: usize,
        /// Names between which the first number is missing.
        leap: Option<[String; 2]>,
    },
    #[error(
        "{count} silhouettes: --keep compares every two, of at most {limit}: use every {every}th frame (--every {every}), or \
         fewer views"
    )]
    TooMany { count: usize, limit: usize, every: usize },
    #[error("no performance to draw")]
    NoPerformance,
    #[error("the shadow detector {method} compares colours, but the video is grey")]
    NeedsColour { method: Method },
}

fn fitting(template: Option<&str>) -> String {
    let none = "; no built-in template fits it: name a file of your own with --template (TOML: `[[part]]` with name, markers, \
                thickness_mm)";
    template.map_or(none.to_owned(), |name| format!("; the built-in template `{name}` fits it"))
}

fn leaping(leap: Option<&[String; 2]>) -> String {
    leap.map_or(String::new(), |[before, after]| format!("; numbers leap from `{before}` to `{after}`"))
}

impl SilhouettesError {
    fn too_large(what: &str, points_mm: &[[f64; 2]], mm_per_px: f64) -> Self {
        let finite = || points_mm.iter().flatten().copied().filter(|v| v.is_finite());
        Self::TooLarge {
            what: what.into(),
            low_mm: finite().reduce(f64::min).unwrap_or(0.0),
            high_mm: finite().reduce(f64::max).unwrap_or(0.0),
            mm_per_px,
        }
    }
}

pub(crate) fn frame_of(pixels: &Pixels) -> Frame<'_> {
    match pixels {
        Pixels::Grey(pixels) => Frame::Grey(pixels.view()),
        Pixels::Rgb(pixels) => Frame::Rgb(pixels.view()),
    }
}

/// Crops the subject to 100x100 pixels; an empty mask remains empty.
fn cut_out(mask: &Mask) -> Mask {
    centred(mask.view(), SIDE_PX).unwrap_or_else(|| Mask::from_elem((SIDE_PX, SIDE_PX), false))
}
