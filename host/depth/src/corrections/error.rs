//! Errors of patterns, stored corrections and maps.

use super::{FORMAT, Method};

/// Why a correction cannot be learned, loaded or applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CorrectionError {
    /// No method of that name.
    #[error("`{0}` is not a correction: use {known}", known = Method::names())]
    UnknownMethod(String),
    /// Too few patterns.
    #[error("{given} patterns at different depths: {method} needs at least {needed}, 20 to 30 are good")]
    TooFewPatterns {
        /// The method.
        method: Method,
        /// How many there are.
        given: usize,
        /// How many it needs.
        needed: usize,
    },
    /// Two patterns of one depth.
    #[error("two patterns at {0} mm: each needs another depth")]
    RepeatedDepth(f64),
    /// An invalid true depth.
    #[error("the true depth {true_mm} mm of pattern {index} is not a positive, finite number")]
    TrueDepth {
        /// Index of the pattern.
        index: usize,
        /// The value that was given.
        true_mm: f64,
    },
    /// Patterns of different size.
    #[error(
        "pattern {index} is {found_width}x{found_height}, the first {width}x{height}: patterns must have one size"
    )]
    PatternSize {
        /// Index of the pattern.
        index: usize,
        /// Width of the first.
        width: usize,
        /// Height of the first.
        height: usize,
        /// Width found.
        found_width: usize,
        /// Height found.
        found_height: usize,
    },
    /// Maps that are too small.
    #[error("maps of {width}x{height} px: at least {least}x{least} are needed")]
    TooSmall {
        /// Width.
        width: usize,
        /// Height.
        height: usize,
        /// Smallest side.
        least: usize,
    },
    /// A least squares without a solution.
    #[error(
        "{what}: {samples} valid samples do not determine {terms} terms; take targets whose depth maps have fewer holes"
    )]
    Underdetermined {
        /// Name of the fit.
        what: String,
        /// Valid samples.
        samples: usize,
        /// Unknowns.
        terms: usize,
    },
    /// A pattern without values over a wide area.
    #[error("pattern {index} ({true_mm} mm) has no value within reach of column {column}, row {row}")]
    PatternHole {
        /// Index of the pattern, farthest first.
        index: usize,
        /// Its true depth.
        true_mm: f64,
        /// Column of the hole.
        column: usize,
        /// Row of the hole.
        row: usize,
    },
    /// A setting of CDC that makes no sense.
    #[error("{name} = {value}: must lie between {least} and {most}")]
    Setting {
        /// Name of the parameter.
        name: &'static str,
        /// The value that was given.
        value: f64,
        /// Least.
        least: f64,
        /// Most.
        most: f64,
    },
    /// A map of another size.
    #[error(
        "a depth map of {width}x{height} px, the correction is for {made_for_width}x{made_for_height}: \
         calibrate at the size that is measured"
    )]
    SizeMismatch {
        /// Width of the map.
        width: usize,
        /// Height of the map.
        height: usize,
        /// Width of the correction.
        made_for_width: usize,
        /// Height of the correction.
        made_for_height: usize,
    },
    /// Optics of another working range.
    #[error(
        "the correction was learned from {correction_near_mm} to {correction_far_mm} mm, the optics work from \
         {near_mm:.2} to {far_mm:.2} mm: calibrate with these optics"
    )]
    RangeMismatch {
        /// Farthest pattern.
        correction_far_mm: f64,
        /// Nearest pattern.
        correction_near_mm: f64,
        /// Far end of the optics.
        far_mm: f64,
        /// Near end of the optics.
        near_mm: f64,
    },
    /// A stored correction of another version.
    #[error("a correction of format {found}, this program reads format {FORMAT}: calibrate again")]
    Format {
        /// The stored version.
        found: u32,
    },
    /// A stored correction whose numbers do not fit together.
    #[error("a stored correction is damaged: {0}")]
    Damaged(String),
    /// A method that only the host has.
    #[error("the board does not know {0}: it corrects with {known}", known = Method::board_names())]
    NotOnBoard(Method),
    /// Something that does not fit the board's number formats.
    #[error("not for the board: {0}")]
    Board(#[from] farnear_maths::clsf::Error),
}
