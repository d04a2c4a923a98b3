//! How a workflow and the person it works for hear of each other: progress, questions, cancelling.
//!
//! A workflow writes nothing to a terminal, reads no keyboard and listens for no signal; whoever starts it (the command
//! line, a web page, a batch runner, Python) gives it a [`Context`].

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use crate::{
    cache::Cache,
    error::{Result, WorkflowError},
};

/// Told what is being done.
pub trait Progress: Sync {
    /// A step in words, for a log: "moving the coarse stage to 5800.000 um".
    fn say(&self, what: &str);

    /// Something that the user should know though the work goes on.
    fn warn(&self, what: &str) {
        self.say(&format!("warning: {what}"));
    }

    /// How much longer it will take, as far as that can be told; said before the count that it belongs to.
    fn time_left(&self, _left: Duration) {}

    /// How far the work has come: `done` of `total` (where that is known) of what `unit` names, e.g. "frames".
    fn advance(&self, _unit: &'static str, _done: usize, _total: Option<usize>) {}
}

/// Asked what only a person can tell or do.
pub trait Questions: Sync {
    /// Shows the question and gives the answer as it was typed; an empty one where the person only agreed.
    ///
    /// # Errors
    /// [`WorkflowError::Unanswered`] where nobody is there, [`WorkflowError::Cancelled`] where the person gave up.
    fn ask(&self, question: &str, cancel: &Cancel) -> Result<String>;
}

/// A wish to stop, shared by whoever may utter it and whoever has to heed it. A rig workflow that is cancelled stops the
/// rig before it returns.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Utters the wish; nothing takes it back.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was uttered.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// # Errors
    /// [`WorkflowError::Cancelled`] where it was uttered; `during` says what was under way.
    pub fn check(&self, during: &str) -> Result<()> {
        match self.is_cancelled() {
            true => Err(WorkflowError::Cancelled { during: during.into() }),
            false => Ok(()),
        }
    }

    /// The flag itself, as the rig's client takes it.
    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }
}

/// What a workflow is given beside its own settings.
#[derive(Clone)]
pub struct Context<'a> {
    /// Told what is being done.
    pub progress: &'a dyn Progress,
    /// Asked what only a person can tell or do.
    pub questions: &'a dyn Questions,
    /// Cancellation.
    pub cancel: Cancel,
    /// Operators, corrections and models that tasks share.
    pub cache: Arc<Cache>,
}

impl<'a> Context<'a> {
    /// A context with an empty cache.
    pub fn new(progress: &'a dyn Progress, questions: &'a dyn Questions, cancel: Cancel) -> Self {
        Self { progress, questions, cancel, cache: Arc::default() }
    }

    /// A step in words.
    pub fn say(&self, what: &str) {
        self.progress.say(what);
    }
}

/// Nobody: progress is not shown, questions have no answer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nobody;

impl Progress for Nobody {
    fn say(&self, _: &str) {}
}

impl Questions for Nobody {
    fn ask(&self, question: &str, _: &Cancel) -> Result<String> {
        Err(WorkflowError::Unanswered { question: question.into() })
    }
}

impl Context<'static> {
    /// For work that nobody watches.
    pub fn unattended() -> Self {
        Self::new(&Nobody, &Nobody, Cancel::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wish_is_heard_by_every_copy() {
        let context = Context::unattended();
        let copy = context.cancel.clone();
        assert!(context.cancel.check("waiting").is_ok());
        copy.cancel();
        let error = context.cancel.check("waiting").unwrap_err();
        assert!(matches!(error, WorkflowError::Cancelled { during } if during == "waiting"));
    }

    #[test]
    fn nobody_answers() {
        let context = Context::unattended();
        let error = context.questions.ask("ready?", &context.cancel).unwrap_err();
        assert!(matches!(error, WorkflowError::Unanswered { question } if question == "ready?"));
    }
}
