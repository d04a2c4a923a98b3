//! The page as the face of a workflow: messages go into the state, prompts wait for an answer.

use std::{
    sync::Mutex,
    time::{Duration, Instant},
};

use farnear_workflows::{Cancel, Progress, Questions, WorkflowError};

use crate::{
    app::{App, lock},
    job_queue::Place,
    view::JobProgress,
};

/// Poll interval for an answer.
const LOOK: Duration = Duration::from_millis(50);
const WARNINGS: usize = 20;
/// Shortest interval between counts, except the last: each publishes the whole state.
const COUNT: Duration = Duration::from_millis(100);

pub struct Face<'a> {
    pub app: &'a App,
    pub place: Place,
    /// Time of the last reported count.
    pub counted: Mutex<Option<Instant>>,
}

impl Progress for Face<'_> {
    fn info(&self, what: &str) {
        self.app.note(what);
        self.app.change(|state| {
            if let Some(job) = (self.place)(state) {
                job.said = Some(what.into());
            }
        });
    }

    fn warn(&self, what: &str) {
        self.app.note(format!("warning: {what}"));
        self.app.change(|state| {
            if let Some(job) = (self.place)(state).as_mut().filter(|job| job.warnings.len() < WARNINGS) {
                job.warnings.push(what.into());
            }
        });
    }

    fn advance(&self, unit: &'static str, done: usize, total: Option<usize>) {
        let mut counted = lock(&self.counted);
        if total != Some(done) && counted.is_some_and(|counted| counted.elapsed() < COUNT) {
            return;
        }
        *counted = Some(Instant::now());
        drop(counted);
        self.app.change(|state| {
            if let Some(job) = (self.place)(state) {
                job.progress = Some(JobProgress { unit: unit.into(), done, total });
            }
        });
    }
}

impl Questions for Face<'_> {
    fn ask(&self, question: &str, cancel: &Cancel) -> Result<String, WorkflowError> {
        *lock(&self.app.answer) = None;
        self.app.change(|state| {
            state.question = Some(question.trim().into());
            state.questions += 1;
        });
        let answered = self.answer(cancel);
        // Here, not at the end of a job: the other queue's jobs end while this one waits.
        self.app.change(|state| state.question = None);
        answered
    }
}

impl Face<'_> {
    fn answer(&self, cancel: &Cancel) -> Result<String, WorkflowError> {
        loop {
            if let Some(answer) = lock(&self.app.answer).take() {
                return Ok(answer);
            }
            cancel.check("waiting for an answer")?;
            std::thread::sleep(LOOK);
        }
    }
}
