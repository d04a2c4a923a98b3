//! Ring of numbered events, to send and (`ReadEvent`) repeat. One overwritten unsent is a gap. RAM: about 1.5 KiB.

use farnear_protocol::BoardMicros;
use farnear_protocol::message::{Event, EventKind};

pub const RETAINED: u32 = 16;

#[derive(Clone, Debug)]
pub(crate) struct Events {
    ring: [Option<Event>; RETAINED as usize],
    next: u32,
    unsent: u32,
}

impl Events {
    pub(crate) const fn new() -> Self {
        Self { ring: [const { None }; RETAINED as usize], next: 0, unsent: 0 }
    }

    pub(crate) const fn next_number(&self) -> u32 {
        self.next
    }

    pub(crate) const fn oldest(&self) -> u32 {
        self.next.saturating_sub(RETAINED)
    }

    /// Numbers end after 2^32 events, 50 days at a thousand a second: nothing is sent then until a reset.
    pub(crate) fn push(&mut self, time: BoardMicros, kind: EventKind) {
        self.ring[(self.next % RETAINED) as usize] = Some(Event { time, kind });
        self.next = self.next.saturating_add(1);
    }

    pub(crate) fn get(&self, number: u32) -> Option<&Event> {
        if !(self.oldest()..self.next).contains(&number) {
            return None;
        }
        self.ring[(number % RETAINED) as usize].as_ref()
    }

    /// The next event to send; counts as sent.
    pub(crate) fn send(&mut self) -> Option<(u32, &Event)> {
        let number = self.unsent.max(self.oldest());
        if number >= self.next {
            return None;
        }
        self.unsent = number + 1;
        self.get(number).map(|event| (number, event))
    }

    pub(crate) const fn all_sent(&self) -> bool {
        self.unsent >= self.next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(request: u32) -> EventKind {
        EventKind::ProgramDone { request, exposures: 0 }
    }

    #[test]
    fn the_last_sixteen_can_be_read_and_the_rest_is_a_gap() {
        let mut events = Events::new();
        assert!(events.send().is_none());
        for number in 0..20 {
            events.push(BoardMicros(u64::from(number)), event(number));
        }
        assert_eq!((events.oldest(), events.next_number()), (4, 20));
        assert!(events.get(3).is_none() && events.get(20).is_none());
        assert_eq!(events.get(4).map(|event| event.time), Some(BoardMicros(4)));
        let sent: std::vec::Vec<u32> =
            core::iter::from_fn(|| events.send().map(|(number, _)| number)).collect();
        assert_eq!(sent, (4..20).collect::<std::vec::Vec<_>>());
        assert!(events.all_sent());
    }
}
