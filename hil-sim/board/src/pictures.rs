//! Whether virtual time stands for pictures: the emulated board may expose faster than pictures are rendered and fetched, and no camera
//! has room for hundreds of them.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

/// Pictures that may wait.
const WAITING_MAX: usize = 8;
/// So long by the wall clock time stands without a picture being fetched; then nobody is taken to want them.
const PATIENCE: Duration = Duration::from_secs(1);

/// See the module.
pub struct Pictures {
    waiting: Option<Arc<AtomicUsize>>,
    last: usize,
    /// When the last one was fetched, or the first was too many.
    since: Option<Instant>,
}

impl Pictures {
    /// `waiting` counts those that wait; without it nobody renders any.
    pub fn new(waiting: Option<Arc<AtomicUsize>>) -> Self {
        Self { waiting, last: 0, since: None }
    }

    /// An exposure was taken.
    pub fn add(&self) {
        if let Some(waiting) = &self.waiting {
            waiting.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether time is to stand.
    pub fn are_awaited(&mut self) -> bool {
        let Some(waiting) = &self.waiting else { return false };
        let count = waiting.load(Ordering::Relaxed);
        if count < WAITING_MAX || count < self.last {
            self.since = None;
        }
        self.last = count;
        count >= WAITING_MAX && self.since.get_or_insert_with(Instant::now).elapsed() < PATIENCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_stands_until_a_picture_is_fetched() {
        let waiting = Arc::new(AtomicUsize::new(0));
        let mut pictures = Pictures::new(Some(Arc::clone(&waiting)));
        for _ in 1..WAITING_MAX {
            pictures.add();
            assert!(!pictures.are_awaited());
        }
        pictures.add();
        assert!(pictures.are_awaited());
        waiting.fetch_sub(1, Ordering::Relaxed);
        assert!(!pictures.are_awaited());
    }
}
