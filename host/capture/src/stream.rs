//! Events and log frames as streams, for whoever wants to follow what the board says.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel},
    },
    time::Duration,
};

use farnear_protocol::{Event, message::Hello};

use crate::error::ClientError;

/// What a stream holds for a reader that is late; a reader that is later loses the stream, not the memory.
const BACKLOG: usize = 4096;

/// Something that a stream of events tells.
#[derive(Clone, Debug)]
pub enum News {
    /// The board said something. The numbers are without gaps within a session.
    Event {
        /// Its running number in this boot.
        number: u32,
        /// When and what.
        event: Event,
    },
    /// The line broke, the board was reset, or events are lost for good. The stream goes on.
    Broken(ClientError),
    /// The board is there again, in a new session.
    Joined(Arc<Hello>),
}

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

/// A stream of [`News`] or [`LogPart`]s. As an iterator it blocks, and ends when the last [`crate::Client`] has gone, or
/// when this reader is thousands of items behind.
pub struct Stream<T> {
    items: Receiver<T>,
}

impl<T> Stream<T> {
    pub(crate) fn new() -> (SyncSender<T>, Self) {
        let (sender, items) = sync_channel(BACKLOG);
        (sender, Self { items })
    }

    /// The next item, waiting at most `wait`; `Ok(None)` where none came.
    ///
    /// # Errors
    /// [`StreamEnded`].
    pub fn next_within(&self, wait: Duration) -> Result<Option<T>, StreamEnded> {
        match self.items.recv_timeout(wait) {
            Ok(item) => Ok(Some(item)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(StreamEnded),
        }
    }

    /// What lies ready, without waiting.
    ///
    /// # Errors
    /// [`StreamEnded`].
    pub fn ready(&self) -> Result<Option<T>, StreamEnded> {
        match self.items.try_recv() {
            Ok(item) => Ok(Some(item)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(StreamEnded),
        }
    }
}

impl<T> Iterator for Stream<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        self.items.recv().ok()
    }
}

/// Nothing more comes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the stream has ended: its port was closed, or this reader was too far behind")]
pub struct StreamEnded;

/// The readers of a stream.
pub(crate) struct Audience<T> {
    readers: Vec<SyncSender<T>>,
}

impl<T> Default for Audience<T> {
    fn default() -> Self {
        Self { readers: Vec::new() }
    }
}

impl<T: Clone> Audience<T> {
    pub(crate) fn add(&mut self, reader: SyncSender<T>) {
        self.readers.push(reader);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.readers.is_empty()
    }

    /// Tells all; who has gone or is too far behind is left out from now on.
    pub(crate) fn tell(&mut self, item: &T) {
        self.readers.retain(|reader| match reader.try_send(item.clone()) {
            Ok(()) => true,
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => false,
        });
    }
}
