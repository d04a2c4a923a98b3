//! Files that another program holds for moments. Windows neither renames nor removes them, and virus scanners, indexers and
//! synchronisation open every new file.

use std::{
    fs, io,
    path::Path,
    thread,
    time::{Duration, Instant},
};

/// Longest wait for the other program.
const HELD_MAX: Duration = Duration::from_secs(2);
const LOOK: Duration = Duration::from_millis(20);

/// Renames as [`fs::rename`].
pub fn rename(from: &Path, to: &Path) -> io::Result<()> {
    patiently(is_held, || fs::rename(from, to))
}

/// Removes as [`fs::remove_file`].
pub fn remove_file(path: &Path) -> io::Result<()> {
    patiently(is_held, || fs::remove_file(path))
}

/// Access denied, or a sharing violation.
fn is_held(error: &io::Error) -> bool {
    cfg!(windows) && matches!(error.raw_os_error(), Some(5 | 32))
}

fn patiently(is_held: impl Fn(&io::Error) -> bool, work: impl Fn() -> io::Result<()>) -> io::Result<()> {
    let start = Instant::now();
    loop {
        match work() {
            Err(error) if is_held(&error) && start.elapsed() < HELD_MAX => thread::sleep(LOOK),
            ended => return ended,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{cell::Cell, io::ErrorKind};

    use super::*;

    #[test]
    fn a_held_file_is_tried_again_and_another_error_is_not() {
        for (first, attempts) in [(ErrorKind::PermissionDenied, 3), (ErrorKind::NotFound, 1)] {
            let tried = Cell::new(0);
            let ended = patiently(
                |error| error.kind() == ErrorKind::PermissionDenied,
                || {
                    tried.set(tried.get() + 1);
                    if tried.get() < 3 { Err(first.into()) } else { Ok(()) }
                },
            );
            assert_eq!((tried.get(), ended.is_ok()), (attempts, attempts == 3), "{first}");
        }
    }
}
