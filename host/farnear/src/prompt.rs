//! Asking the user at the terminal, so that an interruption (Ctrl-C) is heard while nobody types.

use std::{
    io::{BufRead, Write},
    sync::mpsc::{RecvTimeoutError, channel},
    time::Duration,
};

use anyhow::{Context, Result, bail};

/// From one look at the interruption to the next.
const LOOK: Duration = Duration::from_millis(50);

/// Prints a question on stderr and gives the line that is typed. `nobody` says what to do where the input has ended.
///
/// # Errors
/// When the input has ended, cannot be read, or `interrupted` says so.
pub fn ask(question: &str, nobody: &str, interrupted: impl Fn() -> bool) -> Result<String> {
    eprint!("{question}");
    std::io::stderr().flush().context("cannot write to the terminal")?;
    // A read is not ended by Ctrl-C; so it waits in a thread of its own, which ends with the program at the latest.
    let (sender, typed) = channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let read = std::io::stdin().lock().read_line(&mut line).map(|count| (count, line));
        let _ = sender.send(read); // nobody listens after an interruption
    });
    loop {
        match typed.recv_timeout(LOOK) {
            Ok(Ok((0, _))) => bail!("nobody answers, the input has ended; {nobody}"),
            Ok(line) => return Ok(line.context("cannot read the answer")?.1),
            Err(RecvTimeoutError::Timeout) if interrupted() => {
                eprintln!();
                bail!("interrupted");
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => bail!("the input was lost"),
        }
    }
}
