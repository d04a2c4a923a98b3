//! The board's log as a stream, for whoever wants to follow it.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel},
    time::Duration,
};

/// What a stream holds for a reader that is late; a reader that is later loses the stream, not the memory.
const BACKLOG: usize = 4096;

/// A piece of the board's log.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LogPart {
    /// Its running number in this boot.
    pub number: u32,
    /// So many pieces before it are missing.
    pub missing: u32,
    /// Bytes of the defmt stream.
    pub bytes: Vec<u8>,
}

/// A stream of [`LogPart`]s. It ends when the last [`crate::Client`] has gone, or when this reader is thousands of items
/// behind.
pub struct LogStream {
    parts: Receiver<LogPart>,
}

impl LogStream {
    pub(crate) fn new() -> (SyncSender<LogPart>, Self) {
        let (sender, parts) = sync_channel(BACKLOG);
        (sender, Self { parts })
    }

    /// The next piece, waiting at most `wait`; `Ok(None)` where none came.
    pub fn next_within(&self, wait: Duration) -> Result<Option<LogPart>, LogEnded> {
        match self.parts.recv_timeout(wait) {
            Ok(part) => Ok(Some(part)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(LogEnded),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the log has ended: its port was closed, or this reader was too far behind")]
pub struct LogEnded;

/// The readers of the log.
#[derive(Default)]
pub(crate) struct Readers(Vec<SyncSender<LogPart>>);

impl Readers {
    pub(crate) fn add(&mut self, reader: SyncSender<LogPart>) {
        self.0.push(reader);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Tells all; who has gone or is too far behind is left out from now on.
    pub(crate) fn tell(&mut self, part: &LogPart) {
        self.0.retain(|reader| match reader.try_send(part.clone()) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        });
    }
}
