//! Runs a test program with a time limit: a hang, or a child with the output open, must not hide other results.

use std::{
    io::{self, Read, Write},
    process::{Child, Command, Stdio},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, channel},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};

use crate::run::describe;

/// The longest takes seven minutes on two busy cores.
const LIMIT: Duration = Duration::from_secs(20 * 60);
/// Time for the last output after a program's end.
const LAST: Duration = Duration::from_secs(if cfg!(test) { 1 } else { 5 });
const LOOK: Duration = Duration::from_millis(20);

pub struct Output {
    pub text: String,
    /// Ended without being killed, with success.
    pub well: bool,
}

/// Errors are shown immediately, output at the end.
pub fn run(command: &mut Command) -> Result<Output> {
    let finished = run_for(command, LIMIT)?;
    print!("\n{}\n{}", describe(command), finished.text);
    Ok(finished)
}

pub fn run_for(command: &mut Command, limit: Duration) -> Result<Output> {
    let named = describe(command);
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.with_context(|| format!("cannot start {named}"))?;
    let text = Arc::new(Mutex::new(Vec::new()));
    let mut ends = Vec::new();
    if let Some(stdout) = child.stdout.take() {
        let text = Arc::clone(&text);
        ends.push(read(stdout, move |part| {
            text.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(part);
        }));
    }
    if let Some(stderr) = child.stderr.take() {
        ends.push(read(stderr, |part| {
            let _ = io::stderr().write_all(part); // a closed stderr needs no output
        }));
    }
    let well = ends_well(&mut child, limit).with_context(|| format!("cannot wait for {named}"))?;
    match well {
        None => eprintln!("not ended within {} s, and killed: {named}", limit.as_secs()),
        Some(_) if !ends.iter().all(|end| end.recv_timeout(LAST).is_ok()) => {
            eprintln!("ended, but a child process still holds its output: {named}");
        }
        Some(_) => {}
    }
    let text = text.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(Output { text: String::from_utf8_lossy(&text).into_owned(), well: well == Some(true) })
}

/// `None` if it had to be killed.
fn ends_well(child: &mut Child, limit: Duration) -> io::Result<Option<bool>> {
    let begin = Instant::now();
    while begin.elapsed() < limit {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status.success()));
        }
        thread::sleep(LOOK);
    }
    child.kill()?;
    child.wait()?;
    Ok(None)
}

fn read(mut from: impl Read + Send + 'static, mut take: impl FnMut(&[u8]) + Send + 'static) -> Receiver<()> {
    let (end, ended) = channel();
    thread::spawn(move || {
        let mut part = [0; 1 << 14];
        while let Ok(length @ 1..) = from.read(&mut part) {
            take(&part[..length]);
        }
        let _ = end.send(()); // the receiver may be gone
    });
    ended
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str, limit: Duration) -> (String, bool, Duration) {
        let begin = Instant::now();
        let Output { text, well } = run_for(Command::new("sh").args(["-c", script]), limit).expect("a shell");
        (text, well, begin.elapsed())
    }

    #[test]
    fn a_hanging_program_is_killed_and_its_output_kept() {
        let (text, well, took) = shell("echo begun; exec sleep 60", Duration::from_millis(300));
        assert_eq!((text.as_str(), well), ("begun\n", false));
        assert!(took < Duration::from_secs(30), "{took:?}");
    }

    #[test]
    fn a_leftover_child_process_is_not_awaited() {
        let (text, well, took) = shell("sleep 60 & echo done", Duration::from_secs(50));
        assert_eq!((text.as_str(), well), ("done\n", true));
        assert!(took < Duration::from_secs(30), "{took:?}");
    }

    #[test]
    fn failures_are_seen() {
        let (text, well, _) = shell("echo a; exit 3", Duration::from_secs(50));
        assert_eq!((text.as_str(), well), ("a\n", false));
    }
}
