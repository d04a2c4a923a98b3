//! Errors of patterns, stored corrections and maps.

use super::{FORMAT, Method};

/// Why a correction cannot be learned, loaded or applied. An `index` is of the given patterns from 0; messages count from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CorrectionError {
    #[error("`{0}` is not a correction: use {known}", known = Method::names())]
    UnknownMethod(String),
    #[error("{given} patterns at different depths: {method} needs at least {needed}, 20 to 30 are good")]
    TooFewPatterns { method: Method, given: usize, needed: usize },
    #[error("two patterns at {0} mm: each needs another depth")]
    RepeatedDepth(f64),
    #[error("the true depth {true_mm} mm of pattern {} is not a positive, finite number", .index + 1)]
    TrueDepth { index: usize, true_mm: f64 },
    #[error(
        "pattern {} is {found_width}x{found_height}, the first {width}x{height}: patterns must have one size", .index + 1
    )]
    PatternSize { index: usize, width: usize, height: usize, found_width: usize, found_height: usize },
    #[error("maps of {width}x{height} px: at least {least}x{least} are needed")]
    TooSmall { width: usize, height: usize, least: usize },
    #[error(
        "{what}: {samples} valid samples do not determine {terms} terms; take targets whose depth maps have fewer holes"
    )]
    Underdetermined { what: String, samples: usize, terms: usize },
    #[error("pattern {} ({true_mm} mm) has no value within reach of column {column}, row {row}", .index + 1)]
    PatternHole { index: usize, true_mm: f64, column: usize, row: usize },
    #[error("{name} = {value}: must lie between {least} and {most}")]
    Setting { name: &'static str, value: f64, least: f64, most: f64 },
    #[error(
        "a depth map of {width}x{height} px, the correction is for {made_for_width}x{made_for_height}: \
         calibrate at the size that is measured"
    )]
    SizeMismatch { width: usize, height: usize, made_for_width: usize, made_for_height: usize },
    #[error(
        "the correction was learned from {correction_near_mm} to {correction_far_mm} mm, the optics work from \
         {near_mm:.2} to {far_mm:.2} mm: calibrate with these optics"
    )]
    RangeMismatch { correction_far_mm: f64, correction_near_mm: f64, far_mm: f64, near_mm: f64 },
    #[error("a correction of format {found}, this program reads format {FORMAT}: calibrate again")]
    Format { found: u32 },
    #[error("a stored correction is damaged: {0}")]
    Damaged(String),
    #[error("the board does not know {0}: it corrects with {known}", known = Method::board_names())]
    NotOnBoard(Method),
    #[error("not for the board: {0}")]
    Board(#[from] farnear_maths::clsf::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_count_patterns_from_one() {
        let size = CorrectionError::PatternSize {
            index: 1,
            width: 24,
            height: 12,
            found_width: 20,
            found_height: 10,
        };
        assert!(size.to_string().starts_with("pattern 2 is 20x10, the first 24x12"), "{size}");
        let depth = CorrectionError::TrueDepth { index: 0, true_mm: -1.0 };
        assert!(depth.to_string().contains("of pattern 1 is"), "{depth}");
    }
}
