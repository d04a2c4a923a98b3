//! Link rate change. The answer leaves at the old rate, which returns without a valid request within [`LINK_TRIAL`].

use farnear_protocol::message::{LINK_TRIAL, LinkRate};
use farnear_protocol::{BoardMicros, Micros};

use crate::motion::since;

/// Limit for the answer: the longest frame takes 1.3 ms at the fast rate.
const ANSWER_LEAVES: Micros = Micros(20_000);

#[derive(Clone, Copy, Debug)]
enum Change {
    None,
    Asked {
        to: LinkRate,
        at: BoardMicros,
    },
    /// On trial since `since`, with this number of valid requests before.
    Trial {
        back: LinkRate,
        at: BoardMicros,
        requests: u32,
    },
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkSpeed {
    now: LinkRate,
    change: Change,
}

impl LinkSpeed {
    pub(crate) const fn new() -> Self {
        Self { now: LinkRate::START, change: Change::None }
    }

    pub(crate) const fn is_settled(&self) -> bool {
        matches!(self.change, Change::None)
    }

    /// Accepts a request, which confirms the present rate.
    pub(crate) fn ask(&mut self, to: LinkRate, at: BoardMicros) {
        self.change = if to == self.now { Change::None } else { Change::Asked { to, at } };
    }

    /// The new rate, when it changes. `all_sent`: nothing is in transit at the old one; `requests`: valid ones so far.
    pub(crate) fn due(
        &mut self,
        now: BoardMicros,
        requests: u32,
        all_sent: impl FnOnce() -> bool,
    ) -> Option<LinkRate> {
        let (rate, change) = match self.change {
            Change::Asked { to, at } if all_sent() || since(at, now) >= ANSWER_LEAVES => {
                (to, Change::Trial { back: self.now, at: now, requests })
            }
            Change::Trial { requests: before, .. } if requests != before => (self.now, Change::None),
            Change::Trial { back, at, .. } if since(at, now) >= LINK_TRIAL => (back, Change::None),
            Change::None | Change::Asked { .. } | Change::Trial { .. } => return None,
        };
        self.change = change;
        let changes = rate != self.now;
        self.now = rate;
        changes.then_some(rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: LinkRate = LinkRate::Baud921600;

    fn at(micros: u32) -> BoardMicros {
        BoardMicros(u64::from(micros))
    }

    fn changed() -> LinkSpeed {
        let mut speed = LinkSpeed::new();
        speed.ask(SLOW, at(0));
        assert_eq!(speed.due(at(200), 3, || false), None, "the answer has not left");
        assert_eq!(speed.due(at(1_000), 3, || true), Some(SLOW));
        speed
    }

    #[test]
    fn a_rate_at_which_a_request_comes_in_stays() {
        let mut speed = changed();
        assert_eq!(speed.due(at(2_000), 4, || true), None);
        assert_eq!(speed.due(at(10 * LINK_TRIAL.0), 4, || true), None);
    }

    #[test]
    fn a_rate_at_which_nothing_comes_in_is_left_again() {
        let mut speed = changed();
        assert_eq!(speed.due(at(LINK_TRIAL.0 + 999), 3, || true), None);
        assert_eq!(speed.due(at(LINK_TRIAL.0 + 1_000), 3, || true), Some(LinkRate::START));
        assert_eq!(speed.due(at(10 * LINK_TRIAL.0), 3, || true), None);
    }

    #[test]
    fn an_answer_that_never_leaves_holds_nothing_up() {
        let mut speed = LinkSpeed::new();
        speed.ask(SLOW, at(0));
        assert_eq!(speed.due(at(ANSWER_LEAVES.0), 0, || false), Some(SLOW));
    }

    #[test]
    fn requesting_the_current_rate_changes_nothing() {
        let mut speed = LinkSpeed::new();
        speed.ask(LinkRate::START, at(0));
        assert_eq!(speed.due(at(200), 0, || true), None);
    }
}
