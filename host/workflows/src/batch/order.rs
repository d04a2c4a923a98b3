//! Order of the jobs: one that reads the result of another begins when that one has ended.

use std::{
    collections::BTreeSet,
    sync::{Condvar, Mutex, PoisonError},
};

/// Lines of the jobs that have begun and not ended.
#[derive(Default)]
pub(super) struct Running {
    lines: Mutex<BTreeSet<usize>>,
    ended: Condvar,
}

/// Ends its job when dropped, also after a panic, because other threads may wait for it.
pub(super) struct Turn<'a> {
    running: &'a Running,
    line: usize,
}

impl Running {
    /// Called in the order of the manifest: jobs on earlier lines have begun then, so that waiting for them ends.
    pub fn begin(&self, line: usize) -> Turn<'_> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).insert(line);
        Turn { running: self, line }
    }

    /// Waits until the job on `line` has ended.
    pub fn wait_for(&self, line: usize) {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.ended.wait_while(lines, |lines| lines.contains(&line)));
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.running.lines.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.line);
        self.running.ended.notify_all();
    }
}
