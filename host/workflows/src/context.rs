//! Progress, prompts and cancellation for workflows: no terminal, keyboard or signals, only the caller's [`Context`].

#[cfg(test)]
use std::sync::Mutex;
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use crate::{
    cache::Cache,
    error::{Result, WorkflowError},
};

pub trait Progress: Sync {
    /// Reports a step, for a log: "moving the coarse stage to 5800.000 um".
    fn info(&self, what: &str);

    /// Reports a problem that does not stop the work.
    fn warn(&self, what: &str) {
        self.info(&format!("warning: {what}"));
    }

    /// Reports the estimated remaining time, before the count that it belongs to.
    fn time_left(&self, _left: Duration) {}

    /// Reports that `done` of `total` (if known) units are complete; `unit` is e.g. "frames".
    fn advance(&self, _unit: &'static str, _done: usize, _total: Option<usize>) {}
}

pub trait Questions: Sync {
    /// Shows the question and returns the answer; empty if the user only confirmed.
    fn ask(&self, question: &str, cancel: &Cancel) -> Result<String>;
}

/// Polling interval of work that cannot be stopped.
const LOOK: Duration = Duration::from_millis(10);

/// Cancellation token, shared by its clones; cannot be reset. A cancelled rig workflow stops the rig before it returns.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    pub fn check(&self, during: &str) -> Result<()> {
        match self.is_cancelled() {
            true => Err(WorkflowError::Cancelled { during: during.into() }),
            false => Ok(()),
        }
    }

    /// Runs `work`, which cannot be stopped, in a thread that is left behind when this is cancelled.
    pub fn watch<T: Send + 'static>(
        &self,
        during: &str,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        let worker = thread::spawn(work);
        while !worker.is_finished() {
            self.check(during)?;
            thread::sleep(LOOK);
        }
        worker.join().or_else(|panic| std::panic::resume_unwind(panic))
    }

    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }
}

/// A token that is cancelled by setting the flag.
impl From<Arc<AtomicBool>> for Cancel {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }
}

#[derive(Clone)]
pub struct Context<'a> {
    pub progress: &'a dyn Progress,
    pub questions: &'a dyn Questions,
    pub cancel: Cancel,
    pub cache: Arc<Cache>,
}

impl<'a> Context<'a> {
    pub fn new(progress: &'a dyn Progress, questions: &'a dyn Questions, cancel: Cancel) -> Self {
        Self { progress, questions, cancel, cache: Arc::default() }
    }

    pub fn info(&self, what: &str) {
        self.progress.info(what);
    }

    /// Warns of each new remark and appends it to those of the figures.
    pub fn warn(&self, new: impl IntoIterator<Item = String>, remarks: &mut Vec<String>) {
        for remark in new {
            self.progress.warn(&remark);
            remarks.push(remark);
        }
    }
}

/// Discards progress; prompts fail.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unattended;

impl Progress for Unattended {
    fn info(&self, _: &str) {}
}

impl Questions for Unattended {
    fn ask(&self, question: &str, _: &Cancel) -> Result<String> {
        Err(WorkflowError::Unanswered { question: question.into() })
    }
}

impl Context<'static> {
    pub fn unattended() -> Self {
        Self::new(&Unattended, &Unattended, Cancel::default())
    }
}

/// Records reports.
#[cfg(test)]
#[derive(Default)]
pub(crate) struct Heard {
    said: Mutex<Vec<String>>,
    warnings: Mutex<Vec<String>>,
}

#[cfg(test)]
impl Heard {
    pub fn context(&self) -> Context<'_> {
        Context::new(self, &Unattended, Cancel::default())
    }

    pub fn said(&self) -> Vec<String> {
        self.said.lock().unwrap().clone()
    }

    pub fn warnings(&self) -> Vec<String> {
        self.warnings.lock().unwrap().clone()
    }
}

#[cfg(test)]
impl Progress for Heard {
    fn info(&self, what: &str) {
        self.said.lock().unwrap().push(what.into());
    }

    fn warn(&self, what: &str) {
        self.info(&format!("warning: {what}"));
        self.warnings.lock().unwrap().push(what.into());
    }
}

/// Records counts and their totals.
#[cfg(test)]
#[derive(Default)]
pub(crate) struct Counted(pub Mutex<Vec<(usize, Option<usize>)>>);

#[cfg(test)]
impl Progress for Counted {
    fn info(&self, _: &str) {}

    fn advance(&self, _: &'static str, done: usize, total: Option<usize>) {
        self.0.lock().unwrap().push((done, total));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unattended_prompts_fail() {
        let context = Context::unattended();
        let error = context.questions.ask("ready?", &context.cancel).unwrap_err();
        assert!(matches!(error, WorkflowError::Unanswered { question } if question == "ready?"));
    }
}
