use std::sync::{Mutex, PoisonError};

use crate::{context::Context, error::Result};

/// Counts parts of a work over threads. Reported counts increase by one.
pub(crate) struct Counter<'a> {
    context: &'a Context<'a>,
    unit: &'static str,
    done: Mutex<usize>,
}

impl<'a> Counter<'a> {
    pub fn new(context: &'a Context<'_>, unit: &'static str) -> Self {
        Self { context, unit, done: Mutex::new(0) }
    }

    pub fn one(&self, total: Option<usize>) {
        // Locked while reporting, so that counts are in order. A count is valid even after a panic.
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += 1;
        self.context.progress.advance(self.unit, *done, total);
    }

    pub fn check(&self, during: &str) -> Result<()> {
        self.context.cancel.check(during)
    }

    pub fn is_cancelled(&self) -> bool {
        self.context.cancel.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Counted;
    use rayon::prelude::*;

    #[test]
    fn counts_rise_by_one_from_any_thread() {
        let counted = Counted::default();
        let context = Context { progress: &counted, ..Context::unattended() };
        let counter = Counter::new(&context, "clips");
        (0..100).into_par_iter().for_each(|_| counter.one(Some(100)));
        let expected: Vec<_> = (1..=100).map(|done| (done, Some(100))).collect();
        assert_eq!(counted.0.into_inner().unwrap(), expected);
    }
}
