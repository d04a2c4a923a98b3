//! Stops virtual time while pictures wait: exposures may be faster than rendering and transfer.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

const WAITING_MAX: usize = 8;
/// Exposures that wait for a client that fetches none; its camera drops further ones.
const KEPT_MAX: usize = 10_000;
/// Wall-clock timeout without a transfer; after it no client is assumed.
const PATIENCE: Duration = Duration::from_secs(1);

/// A half mirror has two cameras.
pub const CAMERAS_MAX: usize = 2;

/// Counts of exposures and finished pictures, shared between board, renderer and endpoint.
#[derive(Default)]
pub struct Pictures {
    exposed: AtomicUsize,
    done: AtomicUsize,
    /// First wanted exposure per camera; earlier ones are dropped.
    wanted_from: [AtomicUsize; CAMERAS_MAX],
    /// The free run of earlier exposures has ended.
    free_run_from: AtomicUsize,
}

impl Pictures {
    fn expose(&self) {
        self.exposed.fetch_add(1, Ordering::Relaxed);
    }

    pub fn finish(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    /// Drops pictures captured for a client that has disconnected.
    pub fn forget(&self, camera: usize) {
        if let Some(wanted_from) = self.wanted_from.get(camera) {
            wanted_from.store(self.exposed.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }

    /// Drops the pictures of an ended free run, which would delay the next client. A client that fetches its pictures
    /// usually has at most the last [`WAITING_MAX`] to come, and a program's shots may be among them.
    fn end_free_run(&self) {
        let from = self.exposed.load(Ordering::Relaxed).saturating_sub(WAITING_MAX);
        self.free_run_from.store(from, Ordering::Relaxed);
    }

    /// Whether this exposure, counted from 0, belongs to a free run that has ended.
    pub fn is_of_ended_run(&self, number: usize) -> bool {
        number < self.free_run_from.load(Ordering::Relaxed)
    }

    /// Both counted from 0.
    pub fn wants(&self, camera: usize, number: usize) -> bool {
        self.wanted_from.get(camera).is_none_or(|wanted_from| number >= wanted_from.load(Ordering::Relaxed))
    }

    fn waiting(&self) -> usize {
        // Load `done` first: it only grows, and never beyond the other.
        let done = self.done.load(Ordering::Relaxed);
        self.exposed.load(Ordering::Relaxed).saturating_sub(done)
    }
}

pub struct Patience {
    pictures: Option<Arc<Pictures>>,
    last: usize,
    /// Time of the last transfer, or when the queue became full.
    since: Option<Instant>,
}

impl Patience {
    /// Without `pictures` time never stops.
    pub fn new(pictures: Option<Arc<Pictures>>) -> Self {
        Self { pictures, last: 0, since: None }
    }

    /// Counts an exposure; returns whether the camera keeps it.
    pub fn expose(&self) -> bool {
        let Some(pictures) = &self.pictures else { return true };
        let keeps = pictures.waiting() < KEPT_MAX;
        if keeps {
            pictures.expose();
        }
        keeps
    }

    pub fn end_free_run(&self) {
        if let Some(pictures) = &self.pictures {
            pictures.end_free_run();
        }
    }

    pub fn is_asked(&mut self) -> bool {
        let Some(pictures) = &self.pictures else { return false };
        let count = pictures.waiting();
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
    fn time_stops_until_an_image_is_fetched() {
        let pictures = Arc::new(Pictures::default());
        let mut patience = Patience::new(Some(Arc::clone(&pictures)));
        for _ in 1..WAITING_MAX {
            assert!(patience.expose() && !patience.is_asked());
        }
        assert!(patience.expose() && patience.is_asked());
        pictures.finish();
        assert!(!patience.is_asked());
    }

    #[test]
    fn a_client_that_fetches_nothing_leaves_a_bounded_number_of_exposures() {
        let pictures = Arc::new(Pictures::default());
        let patience = Patience::new(Some(Arc::clone(&pictures)));
        let kept = (0..3 * KEPT_MAX).filter(|_| patience.expose()).count();
        assert_eq!((kept, pictures.waiting()), (KEPT_MAX, KEPT_MAX));
        pictures.finish();
        assert!(patience.expose(), "it fetches again");
    }

    #[test]
    fn drops_pictures_exposed_before_the_client_left() {
        let pictures = Pictures::default();
        pictures.expose();
        pictures.expose();
        assert!(pictures.wants(0, 0));
        pictures.forget(0);
        pictures.expose();
        assert_eq!([0, 1, 2].map(|number| pictures.wants(0, number)), [false, false, true]);
        assert_eq!([0, 1, 2].map(|number| pictures.wants(1, number)), [true; 3], "the other camera's");
    }

    #[test]
    fn only_the_last_pictures_of_an_ended_free_run_are_rendered() {
        let pictures = Arc::new(Pictures::default());
        let patience = Patience::new(Some(Arc::clone(&pictures)));
        assert!((0..=WAITING_MAX).all(|_| patience.expose()));
        assert!(!pictures.is_of_ended_run(0));
        patience.end_free_run();
        assert!(patience.expose());
        let dropped: Vec<_> =
            (0..WAITING_MAX + 2).filter(|number| pictures.is_of_ended_run(*number)).collect();
        assert_eq!(dropped, [0]);
    }
}
