//! Masks of a person: from [`video`], from a [motion-capture recording](markers), from body joints of a public set
//! ([`skeletons`]), of made people ([`synthetic`]); masks of others cut into [`passages`]. One file per source; [`performances`] is what the last two share.

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

/// Views round a subject.
pub(crate) const VIEWS: RangeInclusive<usize> = 1..=72;
/// Scale, mm per px.
pub(crate) const MM_PER_PX: RangeInclusive<f64> = 0.1..=1000.0;

/// Why no silhouettes could be made.
#[derive(Debug, thiserror::Error)]
pub enum SilhouettesError {
    /// A recording that cannot be read.
    #[error("{}: {source}", path.display())]
    Recording { path: PathBuf, source: RecordingError },
    /// Joints that cannot be read.
    #[error("{}: {source}", path.display())]
    Skeletons { path: PathBuf, source: SkeletonError },
    /// A template that cannot be read.
    #[error("the template {name}: {source}")]
    Template { name: String, source: TemplateError },
    /// A template with other names than the recording's.
    #[error("{}: {source}{}", path.display(), fitting(*.fits))]
    Unfit {
        path: PathBuf,
        source: TemplateError,
        /// A built-in template that does.
        fits: Option<&'static str>,
    },
    /// A recording without a frame.
    #[error("{}: the recording holds no frame", path.display())]
    NoFrames { path: PathBuf },
    /// A recording in which everything is hidden.
    #[error("{}: no frame has a visible marker, so there is nothing to draw", path.display())]
    NothingVisible { path: PathBuf },
    /// Points too far apart for a picture.
    #[error(
        "{what} reaches from {low_mm:.0} to {high_mm:.0} mm, which is not a picture at {mm_per_px} mm per pixel; the \
         unit may be wrong"
    )]
    TooLarge {
        what: String,
        /// The least of their coordinates in the picture.
        low_mm: f64,
        high_mm: f64,
        /// Millimetres per pixel asked for.
        mm_per_px: f64,
    },
    /// No person stays in the picture for long enough.
    #[error("{}: no person in {least} successive frames", path.display())]
    NoPassage {
        path: PathBuf,
        /// Frames that a passage has at least.
        least: usize,
    },
    /// No performance was chosen.
    #[error("no performance to draw")]
    NoPerformance,
    /// A detector that compares colours.
    #[error("the shadow detector {} compares colours, but the video is grey", method.name())]
    NeedsColour { method: Method },
}

fn fitting(template: Option<&str>) -> String {
    template.map_or(String::new(), |name| format!("; the built-in template `{name}` fits it"))
}

impl SilhouettesError {
    /// Points that fit in no picture.
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

/// A video frame as the background model takes it.
pub(crate) fn frame_of(pixels: &Pixels) -> Frame<'_> {
    match pixels {
        Pixels::Grey(pixels) => Frame::Grey(pixels.view()),
        Pixels::Rgb(pixels) => Frame::Rgb(pixels.view()),
    }
}

/// The subject in 100x100 pixels; an empty mask stays empty.
fn cut_out(mask: &Mask) -> Mask {
    centred(mask.view(), SIDE_PX).unwrap_or_else(|| Mask::from_elem((SIDE_PX, SIDE_PX), false))
}
