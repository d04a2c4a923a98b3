//! Stacks and settings that give no depth.

use super::{LEAST_IMAGES, MOST_GUIDED_PX, MOST_SMOOTHING_PX};

/// Why a stack gives no depth.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum StackError {
    #[error("a stack of {count} images: at least {LEAST_IMAGES} at different focus distances are needed")]
    TooFew { count: usize },
    #[error(
        "image {number} has {width}x{height} px and the first one {}x{}: they must have one size", of.1, of.0
    )]
    Size {
        number: usize,
        width: usize,
        height: usize,
        /// The first one's (height, width).
        of: (usize, usize),
    },
    #[error(
        "images of {width}x{height} px are smaller than the window of {window_px} (window_px): give a smaller window, or larger images"
    )]
    TooSmall { width: usize, height: usize, window_px: usize },
    #[error("{what} is {value}: an odd number from {least} to {most} is needed")]
    Odd { what: &'static str, value: usize, least: usize, most: usize },
    #[error("the images are to be blurred by {0} px: 0 to {MOST_SMOOTHING_PX} is possible")]
    Smoothing(f32),
    #[error("places are to be corrected within {0} px: 0 (off) or 1 to {MOST_GUIDED_PX} is possible")]
    Guided(f32),
    #[error("places of a reliability below {0} are to be removed: 0 to 1 is possible")]
    Reliability(f32),
    #[error(
        "{positions} positions of {images} images: one for each is needed, all different, rising or falling"
    )]
    Positions { images: usize, positions: usize },
    #[error(
        "image {number}: the pixel in column {column}, row {row} is not finite: fill it, or leave the image out"
    )]
    NotFinite { number: usize, column: usize, row: usize },
}
