//! Stacks and settings that give no depth.

use super::{LEAST_IMAGES, MOST_GUIDED_PX, MOST_SMOOTHING_PX};

/// Why a stack gives no depth.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StackError {
    /// Too few images.
    #[error("a stack of {count} images: at least {LEAST_IMAGES} are needed")]
    TooFew {
        /// How many there are.
        count: usize,
    },
    /// Images of different sizes.
    #[error(
        "image {number} has {width}x{height} px and the first one {}x{}: they must have one size", of.1, of.0
    )]
    Size {
        /// Number of the image, from 1.
        number: usize,
        /// Its width.
        width: usize,
        /// Its height.
        height: usize,
        /// The first one's (height, width).
        of: (usize, usize),
    },
    /// Too small for the window.
    #[error("images of {width}x{height} px are smaller than the window of {window_px}")]
    TooSmall {
        /// Width.
        width: usize,
        /// Height.
        height: usize,
        /// Side of the window.
        window_px: usize,
    },
    /// A number that must be odd and in a range.
    #[error("{what} is {value}: an odd number from {least} to {most} is needed")]
    Odd {
        /// Name of the parameter.
        what: &'static str,
        /// Its value.
        value: usize,
        /// Smallest.
        least: usize,
        /// Largest.
        most: usize,
    },
    /// An invalid blur.
    #[error("the images are to be blurred by {0} px: 0 to {MOST_SMOOTHING_PX} is possible")]
    Smoothing(f32),
    /// An invalid reach.
    #[error("places are to be corrected within {0} px: 0 (off) or 1 to {MOST_GUIDED_PX} is possible")]
    Guided(f32),
    /// Positions that are not one for each image, or do not rise or fall.
    #[error(
        "{positions} positions of {images} images: one for each is needed, all different, rising or falling"
    )]
    Positions {
        /// Images.
        images: usize,
        /// Positions.
        positions: usize,
    },
    /// A pixel without a value.
    #[error("image {number}: the pixel in column {column}, row {row} is not finite")]
    NotFinite {
        /// Number of the image, from 1.
        number: usize,
        /// Column.
        column: usize,
        /// Row.
        row: usize,
    },
}
