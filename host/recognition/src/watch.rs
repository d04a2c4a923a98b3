//! Progress and cancellation of training and evaluation, which may take minutes.

/// Progress callbacks and cancellation, called from several threads.
pub trait Watch: Sync {
    /// An evaluation of this many folds begins, each of which tries about so many spaces.
    fn folds_begin(&self, _folds: usize, _spaces: usize) {}

    /// One more space was learned and tried; the total is known only at the end.
    fn space_tried(&self) {}

    /// One more fold of an evaluation is done, of this many.
    fn fold_done(&self, _folds: usize) {}

    /// Whether to stop. The work ends with [`crate::embedding::EmbeddingError::Stopped`] before the next
    /// space.
    fn is_stopped(&self) -> bool {
        false
    }
}

/// Ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watch for Unwatched {}
