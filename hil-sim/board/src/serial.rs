//! The far end of the board's UART: two queues of bytes between the emulator and the outside.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

use rigless::{
    chip::{Timeline, uart::Peer},
    snapshot::Store,
    time::VirtualNanos,
};

/// Bytes on their way, both directions.
#[derive(Debug, Default)]
struct Queues {
    to_board: VecDeque<u8>,
    from_board: Vec<u8>,
}

/// The line; clones are the same line.
#[derive(Clone, Debug, Default)]
pub struct Line(Arc<Mutex<Queues>>);

impl Line {
    fn with<T>(&self, work: impl FnOnce(&mut Queues) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Puts bytes on the line to the board; they arrive one after the other at its baud rate.
    pub fn send(&self, bytes: &[u8]) {
        self.with(|queues| queues.to_board.extend(bytes));
    }

    /// Whether bytes are still on their way to the board.
    pub fn is_sending(&self) -> bool {
        self.with(|queues| !queues.to_board.is_empty())
    }

    /// Takes what the board has sent.
    pub fn take(&self) -> Vec<u8> {
        self.with(|queues| std::mem::take(&mut queues.from_board))
    }
}

impl Peer for Line {
    fn receive(&mut self, word: u16, _context: &mut Timeline<'_, '_>) {
        // 8 data bits; the ninth does not exist on this link.
        self.with(|queues| queues.from_board.push(word as u8));
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        self.with(|queues| queues.to_board.pop_front()).map(u16::from)
    }
}

impl Store for Line {}
