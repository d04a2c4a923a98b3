//! Far end of the board's UART: byte queues between emulator and outside.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

use rigless::{
    chip::{Timeline, uart::Peer},
    snapshot::Store,
    time::VirtualNanos,
};

#[derive(Debug, Default)]
struct Queues {
    to_board: VecDeque<u8>,
    from_board: Vec<u8>,
}

#[derive(Clone, Debug, Default)]
pub struct Line(Arc<Mutex<Queues>>);

impl Line {
    fn with<T>(&self, work: impl FnOnce(&mut Queues) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub fn send(&self, bytes: &[u8]) {
        self.with(|queues| queues.to_board.extend(bytes));
    }

    pub fn is_sending(&self) -> bool {
        self.with(|queues| !queues.to_board.is_empty())
    }

    /// Drops what the board has not heard.
    pub fn lose(&self) {
        self.with(|queues| queues.to_board.clear());
    }

    pub fn take(&self) -> Vec<u8> {
        self.with(|queues| std::mem::take(&mut queues.from_board))
    }
}

impl Peer for Line {
    fn receive(&mut self, word: u16, _context: &mut Timeline<'_, '_>) {
        // 8 data bits; the ninth is unused on this link.
        self.with(|queues| queues.from_board.push(word as u8));
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        self.with(|queues| queues.to_board.pop_front()).map(u16::from)
    }
}

impl Store for Line {}
