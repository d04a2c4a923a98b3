//! Progress and cancellation of training and evaluation.

use std::{
    sync::{Mutex, PoisonError},
    time::Instant,
};

use farnear_recognition::watch::Watch;

use crate::{
    context::Context,
    counter::Counter,
    error::{Result, WorkflowError},
};

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

/// Counts the folds of an evaluation, and estimates the remaining time.
pub(super) struct Folds<'a> {
    context: &'a Context<'a>,
    begun: Instant,
    /// Locked while reporting, so that counts are in order.
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    folds: usize,
    folds_done: usize,
    /// Estimated spaces per fold, and the number tried so far.
    spaces: usize,
    spaces_tried: usize,
}

impl State {
    /// Completed share of the work. A completed fold counts as one, independent of its spaces.
    fn share(&self) -> f64 {
        let each = self.spaces.max(1);
        let spaces = self.spaces_tried.max(self.folds_done * each) as f64;
        (spaces / (self.folds * each).max(1) as f64).min(1.0)
    }
}

impl<'a> Folds<'a> {
    pub fn new(context: &'a Context<'_>) -> Self {
        Self { context, begun: Instant::now(), state: Mutex::default() }
    }

    fn note(&self, change: impl FnOnce(&mut State)) {
        // Counts are valid even after a panic.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut state);
        let share = state.share();
        if share > 0.0 {
            self.context.progress.time_left(self.begun.elapsed().mul_f64(1.0 / share - 1.0));
        }
        self.context.progress.advance("folds", state.folds_done, Some(state.folds));
    }
}

impl Watch for Folds<'_> {
    fn folds_begin(&self, folds: usize, spaces: usize) {
        self.note(|state| *state = State { folds, spaces, ..State::default() });
    }

    fn space_tried(&self) {
        self.note(|state| state.spaces_tried += 1);
    }

    fn fold_done(&self, folds: usize) {
        self.note(|state| {
            state.folds = folds;
            state.folds_done += 1;
        });
    }

    fn is_stopped(&self) -> bool {
        self.context.cancel.is_cancelled()
    }
}

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

pub(super) fn outcome<T, E: Into<WorkflowError>>(
    result: std::result::Result<T, E>,
    context: &Context<'_>,
    during: &str,
) -> Result<T> {
    result.map_err(|error| context.cancel.check(during).err().unwrap_or_else(|| error.into()))
}
