//! Timing of a continuous run. Frame k is due k whole periods after the first, so delays never accumulate. Triggers are
//! ordered a tick ahead, exact by compare match. If position or camera lag, the same shot is due a period later.

use farnear_protocol::{BoardMicros, Micros};

use crate::io::TICK_US;

/// From the ordering tick to the edge: the order is executed before the next tick, however late that is.
const AHEAD_US: u64 = 2 * TICK_US as u64;
/// Unanswered triggers in a row after which the camera is dead.
const UNANSWERED_MAX: u8 = 3;

#[derive(Clone, Debug)]
pub(crate) struct Pace {
    /// 0 = as fast as possible.
    period: Micros,
    /// 0 = endless.
    wanted: u32,
    taken: u32,
    dropped: u32,
    frame: u32,
    /// A frame and its time, the reference of all others.
    begin: Option<(u32, BoardMicros)>,
    unanswered: u8,
}

impl Pace {
    pub(crate) const fn new(period: Micros, wanted: u32) -> Self {
        Self { period, wanted, taken: 0, dropped: 0, frame: 0, begin: None, unanswered: 0 }
    }

    /// Time of the next frame, if its trigger must be ordered now.
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

    /// Whether a missed period is lost: not before the first exposure, and not without a period.
    pub(crate) const fn presses(&self) -> bool {
        self.begin.is_some()
    }

    /// The frame's time came during the previous exposure, whose event precedes its own.
    pub(crate) const fn is_late(&self, due: BoardMicros, now: BoardMicros) -> bool {
        self.presses() && due.0 < now.0 + TICK_US as u64 / 2
    }

    pub(crate) fn take(&mut self, due: BoardMicros) -> u32 {
        if self.period.0 > 0 {
            self.begin.get_or_insert((self.frame, due));
        }
        self.pass()
    }

    pub(crate) const fn drop_frame(&mut self) -> u32 {
        self.dropped = self.dropped.saturating_add(1);
        self.pass()
    }

    const fn pass(&mut self) -> u32 {
        let frame = self.frame;
        self.frame = frame.wrapping_add(1);
        frame
    }

    /// An exposure was answered; returns exposures and dropped frames if it was the last.
    pub(crate) fn answered(&mut self) -> Option<(u32, u32)> {
        self.unanswered = 0;
        self.taken = self.taken.saturating_add(1);
        (self.taken == self.wanted).then_some((self.taken, self.dropped))
    }

    /// Drops the frame of an unanswered trigger. Returns whether to continue.
    pub(crate) const fn unanswered(&mut self) -> bool {
        self.dropped = self.dropped.saturating_add(1);
        self.unanswered += 1; // at most to its limit, which ends the run
        self.unanswered < UNANSWERED_MAX
    }

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
        let late = |now| pace.is_late(BoardMicros(41_400), BoardMicros(now));
        assert_eq!([41_000, 41_199, 41_400, 90_000].map(late), [false, false, true, true]);
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
