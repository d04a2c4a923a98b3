use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel},
    time::Duration,
};

/// Queue limit; a slower reader loses the stream.
const BACKLOG: usize = 4096;

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LogPart {
    pub number: u32,
    pub missing: u32,
    pub bytes: Vec<u8>,
}

/// Stream of [`LogPart`]s. Ends with the last [`crate::Client`], or when the reader is thousands of items late.
pub struct LogStream {
    parts: Receiver<LogPart>,
}

impl LogStream {
    pub(crate) fn new() -> (SyncSender<LogPart>, Self) {
        let (sender, parts) = sync_channel(BACKLOG);
        (sender, Self { parts })
    }

    /// The next part; `Ok(None)` after `wait`.
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

#[derive(Default)]
pub(crate) struct Readers(Vec<SyncSender<LogPart>>);

impl Readers {
    pub(crate) fn add(&mut self, reader: SyncSender<LogPart>) {
        self.0.push(reader);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sends to all readers; removes closed and late ones.
    pub(crate) fn tell(&mut self, part: &LogPart) {
        self.0.retain(|reader| match reader.try_send(part.clone()) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        });
    }
}
