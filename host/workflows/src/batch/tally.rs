//! Progress of the jobs: reports, file of failures, remaining time.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::Instant,
};

use serde_json::Value;

use super::{BatchError, BatchFigures, JobReport, State};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

pub(super) struct Tally<'a> {
    total: usize,
    context: &'a Context<'a>,
    on_job: &'a (dyn Fn(&JobReport) -> io::Result<()> + Sync),
    /// `None` in a dry run.
    failures: Option<PathBuf>,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    figures: BatchFigures,
    file: Option<File>,
    /// Start of the first job that was not already finished.
    working_since: Option<Instant>,
}

impl<'a> Tally<'a> {
    /// Discards the failures of the last run.
    pub fn new(
        total: usize,
        failures: Option<&Path>,
        context: &'a Context<'a>,
        on_job: &'a (dyn Fn(&JobReport) -> io::Result<()> + Sync),
    ) -> Result<Self, BatchError> {
        if let Some(path) = failures {
            match fs::remove_file(path) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(unwritable(path)(source));
                }
                _ => {}
            }
        }
        context.progress.advance("jobs", 0, Some(total));
        let failures = failures.map(Path::to_path_buf);
        Ok(Self { total, context, on_job, failures, inner: Mutex::default() })
    }

    /// Whether a file with this first line is a file of failures.
    pub fn begins(line: &str) -> bool {
        let report: Value = serde_json::from_str(line).unwrap_or_default();
        report["job"].is_u64() && report["state"] == "failed"
    }

    pub fn tell(&self, report: &JobReport) -> Result<()> {
        // Locked during the report, so that lines do not mix and counts increase.
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        inner.figures.jobs += 1;
        match report.state {
            State::Done => inner.figures.done += 1,
            State::Already => inner.figures.already += 1,
            State::Todo => inner.figures.todo += 1,
            State::Failed => {
                inner.figures.failed += 1;
                self.keep(&mut inner.file, report)?;
            }
        }
        (self.on_job)(report).map_err(|source| WorkflowError::Sink { source })?;
        let finished = inner.figures.jobs;
        if report.state == State::Done {
            let now = Instant::now();
            let own = std::time::Duration::from_secs_f64(report.seconds.max(0.0));
            let since = *inner.working_since.get_or_insert_with(|| now.checked_sub(own).unwrap_or(now));
            let each = now.duration_since(since).div_f64(inner.figures.done as f64);
            self.context.progress.time_left(each.mul_f64(self.total.saturating_sub(finished) as f64));
        }
        self.context.progress.advance("jobs", finished, Some(self.total));
        Ok(())
    }

    fn keep(&self, file: &mut Option<File>, report: &JobReport) -> Result<()> {
        let Some(path) = &self.failures else { return Ok(()) };
        let file = match file {
            Some(file) => file,
            None => {
                // Another run at the same time may write there, too.
                let opened = OpenOptions::new().create(true).append(true).open(path);
                file.insert(opened.map_err(unwritable(path))?)
            }
        };
        let line = serde_json::to_string(report).map_err(|error| unwritable(path)(error.into()))?;
        // One write, which the system does not split.
        file.write_all(format!("{line}\n").as_bytes()).map_err(unwritable(path))?;
        Ok(())
    }

    pub fn end(&self) -> BatchFigures {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).figures.clone()
    }
}

fn unwritable(path: &Path) -> impl FnOnce(io::Error) -> BatchError + '_ {
    move |source| BatchError::Report { what: "failures", path: path.into(), reason: source.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_runs_at_once_write_whole_lines() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("failures.jsonl");
        let (context, on_job) = (Context::unattended(), |_: &JobReport| -> io::Result<()> { Ok(()) });
        let tally = || Tally::new(2, Some(&path), &context, &on_job).expect("a writable folder");
        let (one, other) = (tally(), tally());
        for (tally, job, error) in [(&one, 1, "a long reason"), (&other, 1, "short"), (&one, 2, "short")] {
            let report = JobReport {
                job,
                line: job,
                kind: "depth".into(),
                out: None,
                state: State::Failed,
                seconds: 0.0,
                figures: None,
                warnings: Vec::new(),
                error: Some(error.into()),
            };
            tally.tell(&report).expect("a writable file");
        }
        let text = fs::read_to_string(&path).expect("failures");
        assert_eq!(text.lines().filter(|line| Tally::begins(line)).count(), 3, "{text}");
    }
}
