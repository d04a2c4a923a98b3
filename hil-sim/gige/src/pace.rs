//! Packet timing: a burst would overflow the buffer of a receiver that is delayed by milliseconds.

use std::{
    thread,
    time::{Duration, Instant},
};

/// Half a gigabit: a receiver's usual 208 KiB buffer (half of it overhead) lasts 4 ms, a picture takes 10 ms.
const BYTES_PER_SECOND: u64 = 60_000_000;
/// Burst permitted after a pause.
const AT_ONCE: Duration = Duration::from_micros(300);
/// Shorter sleeps take about as long; waits are accumulated.
const SHORTEST_SLEEP: Duration = Duration::from_micros(100);

#[derive(Clone, Copy, Debug)]
pub struct Pace {
    due: Instant,
}

impl Pace {
    pub fn new(now: Instant) -> Self {
        Self { due: now }
    }

    /// Wait before a packet of this size; the next is due after it and not before `gap` (set by the client).
    pub fn wait(&mut self, now: Instant, bytes: usize, gap: Duration) -> Duration {
        // After a delay only the permitted burst is caught up.
        let earliest = now.checked_sub(AT_ONCE).unwrap_or(now);
        self.due = self.due.max(earliest);
        let wait = self.due.saturating_duration_since(now);
        let on_the_line = Duration::from_nanos(bytes as u64 * 1_000_000_000 / BYTES_PER_SECOND);
        self.due += on_the_line.max(gap);
        wait
    }

    pub fn hold(&mut self, bytes: usize, gap: Duration) {
        let wait = self.wait(Instant::now(), bytes, gap);
        if wait >= SHORTEST_SLEEP {
            thread::sleep(wait);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lasts(pace: &mut Pace, begin: Instant, packets: u32, gap: Duration) -> Duration {
        let mut now = begin;
        for _ in 0..packets {
            now += pace.wait(now, 1500, gap);
        }
        now - begin
    }

    #[test]
    fn spreads_a_picture_over_its_time_on_the_line() {
        let begin = Instant::now();
        // 1500 bytes at 60 MB/s are 25 us.
        let took = lasts(&mut Pace::new(begin), begin, 401, Duration::ZERO);
        assert_eq!(took, Duration::from_millis(10));
        let asked = lasts(&mut Pace::new(begin), begin, 401, Duration::from_micros(100));
        assert_eq!(asked, Duration::from_millis(40), "the client's gap is respected");
    }

    #[test]
    fn does_not_catch_up_after_a_pause() {
        let begin = Instant::now();
        let mut pace = Pace::new(begin);
        // After a second of silence 12 packets (300 us) leave immediately, and no more.
        let took = lasts(&mut pace, begin + Duration::from_secs(1), 401, Duration::ZERO);
        assert_eq!(took, Duration::from_micros(10_000 - 300));
    }
}
