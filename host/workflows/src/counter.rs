//! Counting what several threads get done.

use std::sync::{Mutex, PoisonError};

use crate::{context::Context, error::Result};

/// Counts parts of a work over threads, so that whoever watches sees the count rise by one each time, and the last one last.
pub(crate) struct Counter<'a> {
    context: &'a Context<'a>,
    unit: &'static str,
    total: usize,
    done: Mutex<usize>,
}

impl<'a> Counter<'a> {
    /// Nothing is done yet of `total` of what `unit` names.
    pub fn new(context: &'a Context<'_>, unit: &'static str, total: usize) -> Self {
        Self { context, unit, total, done: Mutex::new(0) }
    }

    /// One part is done.
    pub fn one(&self) {
        // Held while it is told, or another thread's higher count might be told first. A count cannot be half-changed.
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += 1;
        self.context.progress.advance(self.unit, *done, Some(self.total));
    }

    /// # Errors
    /// [`crate::WorkflowError::Cancelled`] where the work is to stop.
    pub fn check(&self, during: &str) -> Result<()> {
        self.context.cancel.check(during)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::{Cancel, Nobody, Progress};
    use rayon::prelude::*;

    #[derive(Default)]
    struct Heard(Mutex<Vec<(usize, Option<usize>)>>);

    impl Progress for Heard {
        fn say(&self, _: &str) {}
        fn advance(&self, _: &'static str, done: usize, total: Option<usize>) {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push((done, total));
        }
    }

    #[test]
    fn counts_rise_by_one_whoever_counts() {
        let heard = Heard::default();
        let context = Context { progress: &heard, questions: &Nobody, cancel: Cancel::default() };
        let counter = Counter::new(&context, "clips", 100);
        (0..100).into_par_iter().for_each(|_| counter.one());
        let expected: Vec<_> = (1..=100).map(|done| (done, Some(100))).collect();
        assert_eq!(*heard.0.lock().unwrap_or_else(PoisonError::into_inner), expected);
    }
}
