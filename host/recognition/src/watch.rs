//! Progress and cancellation of training and evaluation.

/// Progress callbacks and cancellation, called from several threads.
pub trait Watch: Sync {
    /// An evaluation of this many folds begins; each tries about `_spaces` spaces.
    fn folds_begin(&self, _folds: usize, _spaces: usize) {}

    /// A space was learned and tried; the total is known only at the end.
    fn space_tried(&self) {}

    /// One of this many folds is done.
    fn fold_done(&self, _folds: usize) {}

    /// Whether to stop before the next space, with [`crate::embedding::EmbeddingError::Stopped`].
    fn is_stopped(&self) -> bool {
        false
    }
}

/// Ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watch for Unwatched {}
