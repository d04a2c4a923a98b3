//! SIGHUP below nohup(1), which ignores it so that the program outlives its terminal.
#![allow(unsafe_code)] // two calls of signal; the block states why they are sound.

/// Runs `listen`, which sets handlers of signals. A SIGHUP that was ignored before stays ignored.
#[cfg(unix)]
pub(crate) fn keep_ignored<T>(listen: impl FnOnce() -> T) -> T {
    // SAFETY: an ignored signal runs no code of the program.
    let ignore = || unsafe { libc::signal(libc::SIGHUP, libc::SIG_IGN) };
    let before = ignore();
    let listening = listen();
    if before == libc::SIG_IGN {
        ignore();
    }
    listening
}

#[cfg(not(unix))]
pub(crate) fn keep_ignored<T>(listen: impl FnOnce() -> T) -> T {
    listen()
}
