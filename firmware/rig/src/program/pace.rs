//! The pace of a continuous run: at which moments exposures are due, and how many were taken.
//!
//! Frame k is due a whole number of periods after the first one, so that no delay adds up. Its trigger is ordered a tick ahead and
//! rises by the camera timer's compare match: to the microsecond, whatever the tick has to do. A moment that finds position or
//! camera not ready passes; the same shot is due at the next.

use farnear_protocol::{BoardMicros, Micros};

use crate::io::TICK_US;

/// From the tick that orders a trigger to its edge: the order is carried out before the next tick, however long that one waits.
const AHEAD_US: u64 = 2 * TICK_US as u64;
/// Triggers in a row that the camera did not answer, after which it is taken for dead.
const UNANSWERED_MAX: u8 = 3;

#[derive(Clone, Debug)]
pub(crate) struct Pace {
    /// 0 = as fast as position and camera allow.
    period: Micros,
    /// Exposures after which it ends; 0 = none.
    wanted: u32,
    taken: u32,
    dropped: u32,
    /// The frame that is due next.
    frame: u32,
    /// A frame and its moment, from which the others count.
    begin: Option<(u32, BoardMicros)>,
    unanswered: u8,
}

impl Pace {
    pub(crate) const fn new(period: Micros, wanted: u32) -> Self {
        Self { period, wanted, taken: 0, dropped: 0, frame: 0, begin: None, unanswered: 0 }
    }

    /// The moment of the next frame, where its trigger is to be ordered now.
    pub(crate) fn due(&self, now: BoardMicros) -> Option<BoardMicros> {
        if self.period.0 == 0 {
            return Some(now);
        }
        let ahead = BoardMicros(now.0 + AHEAD_US);
        let Some((first, begin)) = self.begin else { return Some(ahead) };
        let periods = u64::from(self.frame.wrapping_sub(first));
        let due = BoardMicros(begin.0 + periods * u64::from(self.period.0));
        (due <= ahead).then_some(due)
    }

    /// Whether a moment that finds nothing ready is lost: before the first one, and without a pace, none is.
    pub(crate) const fn presses(&self) -> bool {
        self.begin.is_some()
    }

    /// The next frame is exposed at this moment; gives its number.
    pub(crate) fn take(&mut self, due: BoardMicros) -> u32 {
        if self.period.0 > 0 {
            self.begin.get_or_insert((self.frame, due));
        }
        self.pass()
    }

    /// The next frame's moment passes without an exposure; gives its number.
    pub(crate) const fn drop_frame(&mut self) -> u32 {
        self.dropped = self.dropped.saturating_add(1);
        self.pass()
    }

    const fn pass(&mut self) -> u32 {
        let frame = self.frame;
        self.frame = frame.wrapping_add(1);
        frame
    }

    /// An exposure was answered; gives exposures and dropped frames, if it was the last one wanted.
    pub(crate) fn answered(&mut self) -> Option<(u32, u32)> {
        self.unanswered = 0;
        self.taken = self.taken.saturating_add(1);
        (self.taken == self.wanted).then_some((self.taken, self.dropped))
    }

    /// A trigger was not answered: its frame is dropped. Whether that is to be borne.
    pub(crate) const fn unanswered(&mut self) -> bool {
        self.dropped = self.dropped.saturating_add(1);
        self.unanswered += 1; // at most to its limit, which ends the run
        self.unanswered < UNANSWERED_MAX
    }

    /// The run goes on after a pause: from a moment of its own.
    pub(crate) const fn begin_anew(&mut self) {
        self.begin = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_due_whole_periods_after_the_first() {
        let mut pace = Pace::new(Micros(40_000), 2);
        assert_eq!(pace.due(BoardMicros(1_000)), Some(BoardMicros(1_400)), "the first as soon as it can be");
        assert!(!pace.presses());
        assert_eq!(pace.take(BoardMicros(1_400)), 0);
        assert_eq!((pace.due(BoardMicros(40_999)), pace.presses()), (None, true));
        assert_eq!(pace.due(BoardMicros(41_050)), Some(BoardMicros(41_400)));
        assert_eq!(pace.drop_frame(), 1);
        assert_eq!(pace.due(BoardMicros(81_200)), Some(BoardMicros(81_400)));
        assert_eq!((pace.take(BoardMicros(81_400)), pace.answered()), (2, None));
        pace.begin_anew();
        assert_eq!(pace.due(BoardMicros(500_000)), Some(BoardMicros(500_400)));
        assert_eq!((pace.take(BoardMicros(500_400)), pace.answered()), (3, Some((2, 1))));
    }

    #[test]
    fn a_camera_that_answers_now_and_then_is_borne_and_a_dead_one_is_not() {
        let mut pace = Pace::new(Micros(0), 0);
        assert!(pace.unanswered() && pace.unanswered());
        assert_eq!(pace.answered(), None);
        assert!(pace.unanswered() && pace.unanswered() && !pace.unanswered());
    }
}
