//! When packets leave: not all at once, because the buffer of a receiver that was held up for some milliseconds is short.

use std::{
    thread,
    time::{Duration, Instant},
};

/// What leaves in a second, by itself: half a gigabit's worth. A receiver's usual 208 KiB of buffer, of which half is book-keeping, then stand
/// some 4 ms in which nobody reads, and a picture of 640x480 px at 12 bits is there in 10 ms.
const BYTES_PER_SECOND: u64 = 60_000_000;
/// What may leave at once after a pause.
const AT_ONCE: Duration = Duration::from_micros(300);
/// A shorter sleep takes about as long as this one; waits are gathered until then.
const SHORTEST_SLEEP: Duration = Duration::from_micros(100);

/// A schedule of packets: each is due when the one before it would have passed the line.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    due: Instant,
}

impl Pace {
    /// With nothing on the line.
    pub fn new(now: Instant) -> Self {
        Self { due: now }
    }

    /// How long a packet of so many bytes waits; the next one is due after it, and no sooner than `gap` (what the client asked for).
    pub fn wait(&mut self, now: Instant, bytes: usize, gap: Duration) -> Duration {
        // Who was held up catches up with no more than what may leave at once.
        let earliest = now.checked_sub(AT_ONCE).unwrap_or(now);
        self.due = self.due.max(earliest);
        let wait = self.due.saturating_duration_since(now);
        let on_the_line = Duration::from_nanos(bytes as u64 * 1_000_000_000 / BYTES_PER_SECOND);
        self.due += on_the_line.max(gap);
        wait
    }

    /// Waits until a packet may leave.
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

    /// When the last of so many packets leaves, after the first.
    fn lasts(pace: &mut Pace, begin: Instant, packets: u32, gap: Duration) -> Duration {
        let mut now = begin;
        for _ in 0..packets {
            now += pace.wait(now, 1500, gap);
        }
        now - begin
    }

    #[test]
    fn a_picture_takes_its_time_on_the_line() {
        let begin = Instant::now();
        // 1500 bytes at 60 MB/s are 25 us.
        let took = lasts(&mut Pace::new(begin), begin, 401, Duration::ZERO);
        assert_eq!(took, Duration::from_millis(10));
        let asked = lasts(&mut Pace::new(begin), begin, 401, Duration::from_micros(100));
        assert_eq!(asked, Duration::from_millis(40), "what the client asks for is kept");
    }

    #[test]
    fn a_pause_is_not_made_up_for() {
        let begin = Instant::now();
        let mut pace = Pace::new(begin);
        // After a second of silence 12 packets (300 us) leave at once, and no more.
        let took = lasts(&mut pace, begin + Duration::from_secs(1), 401, Duration::ZERO);
        assert_eq!(took, Duration::from_micros(10_000 - 300));
    }
}
