//! The context of a workflow as what watches a training or an evaluation.

use farnear_activity::recognition::watch::Watch;

use crate::{
    context::Context,
    counter::Counter,
    error::{Result, WorkflowError},
};

/// Counts the spaces that a training tries.
pub(super) struct Training<'a>(Counter<'a>);

impl<'a> Training<'a> {
    pub fn new(context: &'a Context<'_>) -> Self {
        Self(Counter::new(context, "spaces tried"))
    }
}

impl Watch for Training<'_> {
    fn space_tried(&self) {
        self.0.one(None);
    }

    fn is_stopped(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// Counts the folds of an evaluation.
pub(super) struct Folds<'a>(Counter<'a>);

impl<'a> Folds<'a> {
    pub fn new(context: &'a Context<'_>) -> Self {
        Self(Counter::new(context, "folds"))
    }
}

impl Watch for Folds<'_> {
    fn fold_done(&self, folds: usize) {
        self.0.one(Some(folds));
    }

    fn is_stopped(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// Counts the passes of a network's training.
pub(super) struct Passes<'a>(Counter<'a>);

impl<'a> Passes<'a> {
    pub fn new(context: &'a Context<'_>) -> Self {
        Self(Counter::new(context, "passes"))
    }
}

impl Watch for Passes<'_> {
    fn fold_done(&self, passes: usize) {
        self.0.one(Some(passes));
    }

    fn is_stopped(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// What came out of watched work, or that it was cancelled.
pub(super) fn outcome<T, E: Into<WorkflowError>>(
    result: std::result::Result<T, E>,
    context: &Context<'_>,
    during: &str,
) -> Result<T> {
    result.map_err(|error| context.cancel.check(during).err().unwrap_or_else(|| error.into()))
}
