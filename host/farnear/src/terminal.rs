//! The terminal as the face of a workflow: messages on stderr, questions with typed answers, Ctrl-C.

use std::{
    io::{BufRead, IsTerminal, Write},
    sync::{
        OnceLock,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use anyhow::{Context as _, Result};
use farnear_workflows::{Cancel, Context, Progress, Questions, WorkflowError};

use crate::hang_up;

/// Poll interval for the interruption.
const LOOK: Duration = Duration::from_millis(50);
/// Time for a computation to notice that it was cancelled.
const GRACE: Duration = Duration::from_millis(150);
/// Whether Ctrl-C exits after [`GRACE`].
static EXITS: AtomicBool = AtomicBool::new(false);

pub struct Terminal {
    counts: Counts,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Counts {
    Hidden,
    /// On one line, overwritten.
    Rising,
    /// On lines of their own, every [`COUNT_S`].
    Lines,
}

/// Interval between lines with a count, seconds.
const COUNT_S: u64 = 10;
/// When the next line with a count is due, in seconds since the first use of the clock.
static NEXT_COUNT_S: AtomicU64 = AtomicU64::new(0);
/// The last remaining time from [`Progress::time_left`], seconds; `u64::MAX` means unknown.
static LEFT_S: AtomicU64 = AtomicU64::new(u64::MAX);

/// Whether the cursor is behind a count that may be overwritten.
static COUNTING_LINE: AtomicBool = AtomicBool::new(false);

/// Writes to stderr. If it is closed, the work continues without messages.
pub fn say(text: &str) {
    let _ = std::io::stderr().write_all(text.as_bytes());
}

/// Ends the line of a count, so that further text begins on a new line.
pub fn end_count() {
    if COUNTING_LINE.swap(false, Ordering::Relaxed) {
        say("\n");
    }
}

static PLAIN: Terminal = Terminal { counts: Counts::Hidden };

/// The context of a workflow at the terminal. Ctrl-C cancels it.
pub fn context() -> Result<Context<'static>> {
    static CANCEL: OnceLock<Cancel> = OnceLock::new();
    // A program can listen only once.
    if CANCEL.get().is_none() {
        let cancel = Cancel::default();
        let wish = cancel.clone();
        let interrupted = move || {
            wish.cancel();
            if EXITS.load(Ordering::Relaxed) {
                std::thread::sleep(GRACE);
                farnear_files::staging::abandon_all();
                // A pipe that its reader does not empty would hold the message, and with it the exit.
                let (said, heard) = channel();
                std::thread::spawn(move || {
                    say("farnear: interrupted; unfinished files were removed\n");
                    let _ = said.send(()); // the program may have ended
                });
                let _ = heard.recv_timeout(LOOK); // it ends in any case
                std::process::exit(1);
            }
        };
        hang_up::keep_ignored(|| ctrlc::set_handler(interrupted))
            .context("cannot listen for an interruption")?;
        let _ = CANCEL.set(cancel); // there is one thread that starts workflows
    }
    let cancel = CANCEL.get().cloned().unwrap_or_default();
    Ok(Context::new(&PLAIN, &PLAIN, cancel))
}

/// As [`context`]; counts overwrite one line if stderr is a terminal and `json` is false.
pub fn counting(json: bool) -> Result<Context<'static>> {
    static COUNTING: Terminal = Terminal { counts: Counts::Rising };
    let plain = context()?;
    let counts = std::io::stderr().is_terminal() && !json;
    Ok(if counts { Context { progress: &COUNTING, ..plain } } else { plain })
}

/// As [`counting`], for tasks without a rig: Ctrl-C ends the program within 0.3 s.
pub fn computing(json: bool) -> Result<Context<'static>> {
    EXITS.store(true, Ordering::Relaxed);
    counting(json)
}

/// For work of hours: counts with the remaining time. They are lines of their own if stderr is no terminal or
/// figures come between. Ctrl-C ends the program within 0.3 s.
pub fn long_work() -> Result<Context<'static>> {
    EXITS.store(true, Ordering::Relaxed);
    static LINES: Terminal = Terminal { counts: Counts::Lines };
    static RISING: Terminal = Terminal { counts: Counts::Rising };
    let rising = std::io::stderr().is_terminal() && !std::io::stdout().is_terminal();
    Ok(Context { progress: if rising { &RISING } else { &LINES }, ..context()? })
}

/// Returns whether a line with a count is due, and schedules the next.
fn is_due() -> bool {
    static START: OnceLock<Instant> = OnceLock::new();
    let now_s = START.get_or_init(Instant::now).elapsed().as_secs();
    let due = now_s >= NEXT_COUNT_S.load(Ordering::Relaxed);
    if due {
        NEXT_COUNT_S.store(now_s + COUNT_S, Ordering::Relaxed);
    }
    due
}

/// For example 40 s, 12 min, 3 h 20 min.
fn in_words(seconds: u64) -> String {
    match seconds {
        0..100 => format!("{seconds} s"),
        100..6000 => format!("{} min", seconds.div_ceil(60)),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

impl Progress for Terminal {
    fn info(&self, what: &str) {
        end_count();
        say(&format!("{what}\n"));
    }

    fn time_left(&self, left: Duration) {
        LEFT_S.store(left.as_secs(), Ordering::Relaxed);
    }

    fn advance(&self, unit: &'static str, done: usize, total: Option<usize>) {
        let count = match total {
            Some(total) => format!("{done} of {total} {unit}"),
            None => format!("{done} {unit}"),
        };
        let left = match LEFT_S.load(Ordering::Relaxed) {
            0 | u64::MAX => String::new(),
            seconds => format!(", {} left", in_words(seconds)),
        };
        match self.counts {
            Counts::Hidden => return,
            Counts::Lines => {
                if is_due() {
                    say(&format!("{count}{left}\n"));
                }
                return;
            }
            // Blanks overwrite the rest of a longer time.
            Counts::Rising if LEFT_S.load(Ordering::Relaxed) == u64::MAX => say(&format!("\r{count}")),
            Counts::Rising => say(&format!("\r{count}{left:<20}")),
        }
        COUNTING_LINE.store(true, Ordering::Relaxed);
        if total == Some(done) {
            end_count();
        }
    }
}

impl Questions for Terminal {
    fn ask(&self, question: &str, cancel: &Cancel) -> Result<String, WorkflowError> {
        let unanswered = || WorkflowError::Unanswered { question: question.trim().into() };
        std::io::stderr().write_all(question.as_bytes()).map_err(|_| unanswered())?;
        // Ctrl-C does not end a read, so a thread of its own reads; it ends with the program at the latest.
        let (sender, typed) = channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let read = std::io::stdin().lock().read_line(&mut line).map(|count| (count, line));
            let _ = sender.send(read); // the receiver is closed after an interruption
        });
        loop {
            match typed.recv_timeout(LOOK) {
                Ok(Ok((count, line))) if count > 0 => return Ok(line),
                Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => {
                    say("\n");
                    return Err(WorkflowError::Cancelled { during: "waiting for an answer".into() });
                }
                Err(RecvTimeoutError::Timeout) => {}
                Ok(_) | Err(RecvTimeoutError::Disconnected) => return Err(unanswered()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_printed_in_words() {
        for (seconds, words) in [(40, "40 s"), (100, "2 min"), (5999, "100 min"), (12_000, "3 h 20 min")] {
            assert_eq!(in_words(seconds), words);
        }
    }
}
