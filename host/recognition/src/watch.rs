//! Watching a training or an evaluation: with a search both take minutes.

/// Told how far the work has come, and asked whether to go on; by several threads at once.
pub trait Watch: Sync {
    /// An evaluation of this many folds begins, each of which tries about so many spaces.
    fn folds_begin(&self, _folds: usize, _spaces: usize) {}

    /// One more space was learned and tried; a search tries some dozens, how many is known at its end only.
    fn space_tried(&self) {}

    /// One more fold of an evaluation is done, of this many.
    fn fold_done(&self, _folds: usize) {}

    /// Whether to stop. The work ends with [`crate::embedding::EmbeddingError::Stopped`] before the next space is learned.
    fn is_stopped(&self) -> bool {
        false
    }
}

/// Ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watch for Unwatched {}
