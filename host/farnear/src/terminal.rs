//! The terminal as the face of a workflow: what it says on stderr, its questions with the answers that are typed, and
//! Ctrl-C.

use std::{
    io::{BufRead, IsTerminal, Write},
    sync::{
        OnceLock,
        atomic::{AtomicBool, Ordering},
        mpsc::{RecvTimeoutError, channel},
    },
    time::Duration,
};

use anyhow::{Context as _, Result};
use farnear_workflows::{Cancel, Context, Progress, Questions, WorkflowError};

/// From one look at the interruption to the next.
const LOOK: Duration = Duration::from_millis(50);

/// The terminal.
pub struct Terminal {
    /// Whether counts are shown while they rise.
    counts: bool,
}

/// Whether the cursor stands behind a count that may still rise.
static COUNTING_LINE: AtomicBool = AtomicBool::new(false);

/// Ends the line of a count, so that what follows has one of its own.
pub fn end_count() {
    if COUNTING_LINE.swap(false, Ordering::Relaxed) {
        eprintln!();
    }
}

static PLAIN: Terminal = Terminal { counts: false };

/// The context of a workflow at the terminal. Ctrl-C cancels it.
///
/// # Errors
/// Where the system does not let this program listen for Ctrl-C.
pub fn context() -> Result<Context<'static>> {
    static CANCEL: OnceLock<Cancel> = OnceLock::new();
    // A program can listen only once.
    if CANCEL.get().is_none() {
        let cancel = Cancel::default();
        let wish = cancel.clone();
        ctrlc::set_handler(move || wish.cancel()).context("cannot listen for an interruption")?;
        let _ = CANCEL.set(cancel); // there is one thread that starts workflows
    }
    let cancel = CANCEL.get().cloned().unwrap_or_default();
    Ok(Context { progress: &PLAIN, questions: &PLAIN, cancel })
}

/// The same with counts that rise on a line of their own, where stderr is a terminal and `json` is not asked for.
///
/// # Errors
/// As [`context`].
pub fn counting(json: bool) -> Result<Context<'static>> {
    static COUNTING: Terminal = Terminal { counts: true };
    let plain = context()?;
    let counts = std::io::stderr().is_terminal() && !json;
    Ok(if counts { Context { progress: &COUNTING, ..plain } } else { plain })
}

impl Progress for Terminal {
    fn say(&self, what: &str) {
        end_count();
        eprintln!("{what}");
    }

    fn advance(&self, unit: &'static str, done: usize, total: Option<usize>) {
        if !self.counts {
            return;
        }
        match total {
            Some(total) => eprint!("\r{done} of {total} {unit}"),
            None => eprint!("\r{done} {unit}"),
        }
        COUNTING_LINE.store(true, Ordering::Relaxed);
        if total == Some(done) {
            end_count();
        }
    }
}

impl Questions for Terminal {
    fn ask(&self, question: &str, cancel: &Cancel) -> Result<String, WorkflowError> {
        eprint!("{question}");
        let unanswered = || WorkflowError::Unanswered { question: question.trim().into() };
        std::io::stderr().flush().map_err(|_| unanswered())?;
        // A read is not ended by Ctrl-C; so it waits in a thread of its own, which ends with the program at the latest.
        let (sender, typed) = channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let read = std::io::stdin().lock().read_line(&mut line).map(|count| (count, line));
            let _ = sender.send(read); // nobody listens after an interruption
        });
        loop {
            match typed.recv_timeout(LOOK) {
                Ok(Ok((count, line))) if count > 0 => return Ok(line),
                Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => {
                    eprintln!();
                    return Err(WorkflowError::Cancelled { during: "waiting for an answer".into() });
                }
                Err(RecvTimeoutError::Timeout) => {}
                Ok(_) | Err(RecvTimeoutError::Disconnected) => return Err(unanswered()),
            }
        }
    }
}
