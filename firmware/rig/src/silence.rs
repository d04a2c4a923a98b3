//! Supervision of the host's silence. Each request with motion has a silence deadline; the shortest active one counts.
//! Half-way the host is reminded once. Any request of the open session restarts the time; other hosts do not.

use farnear_protocol::{BoardMicros, Micros};

use crate::motion::since;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Silence {
    heard: BoardMicros,
    reminded: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Verdict {
    Fine,
    /// Send [`farnear_protocol::EventKind::StillThere`] for this request.
    Remind(u32),
    /// Stop: the deadline of this request has passed.
    Expired(u32),
}

impl Silence {
    pub(crate) const fn new(now: BoardMicros) -> Self {
        Self { heard: now, reminded: false }
    }

    pub(crate) const fn hear(&mut self, now: BoardMicros) {
        *self = Self::new(now);
    }

    pub(crate) fn time(&self, now: BoardMicros) -> Micros {
        since(self.heard, now)
    }

    /// `shortest` is the active request of the shortest deadline.
    pub(crate) fn check(&mut self, now: BoardMicros, shortest: Option<(u32, Micros)>) -> Verdict {
        let Some((request, allowed)) = shortest else { return Verdict::Fine };
        let silent = since(self.heard, now);
        if silent >= allowed {
            Verdict::Expired(request)
        } else if !self.reminded && silent.0 >= allowed.0 / 2 {
            self.reminded = true;
            Verdict::Remind(request)
        } else {
            Verdict::Fine
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reminds_once_half_way_and_expires_at_the_end() {
        let mut silence = Silence::new(BoardMicros(1_000));
        let allowed = Some((7, Micros(100_000)));
        assert_eq!(silence.check(BoardMicros(900_000), None), Verdict::Fine, "nothing is under way");
        assert_eq!(silence.check(BoardMicros(50_999), allowed), Verdict::Fine);
        assert_eq!(silence.check(BoardMicros(51_000), allowed), Verdict::Remind(7));
        assert_eq!(silence.check(BoardMicros(100_999), allowed), Verdict::Fine);
        silence.hear(BoardMicros(100_999));
        assert_eq!(silence.check(BoardMicros(150_999), allowed), Verdict::Remind(7), "a new period");
        assert_eq!(silence.check(BoardMicros(200_999), allowed), Verdict::Expired(7));
    }
}
