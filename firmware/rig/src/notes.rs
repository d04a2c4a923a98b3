//! Entries of the board's log: changes, rejections, alarms; for later analysis and times without a host.

use farnear_protocol::BoardMicros;
use farnear_protocol::message::{AlarmRecord, Axis, LinkRate, PositionState, RequestError};
use heapless::Deque;

/// Queue length; one is taken per tick, surplus ones are dropped.
const WAITING: usize = 8;

#[derive(Clone, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Note {
    /// Noted once until it recovers.
    StepQueueDry {
        time: BoardMicros,
    },
    Reset,
    Alarm(AlarmRecord),
    AlarmCleared {
        number: u32,
    },
    Refused {
        request: u32,
        error: RequestError,
    },
    Position {
        axis: Axis,
        state: PositionState,
    },
    Session {
        request: u32,
    },
    LinkRate(LinkRate),
}

#[derive(Clone, Debug)]
pub(crate) struct Notes {
    waiting: Deque<Note, WAITING>,
    states: [PositionState; Axis::ALL.len()],
}

impl Notes {
    pub(crate) const fn new() -> Self {
        // The piezo's gauge is absolute.
        let states = [PositionState::Unknown, PositionState::Homed, PositionState::Unknown];
        Self { waiting: Deque::new(), states }
    }

    pub(crate) fn add(&mut self, note: Note) {
        let _ = self.waiting.push_back(note); // without room it is left out
    }

    pub(crate) fn look(&mut self, state: impl Fn(Axis) -> PositionState) {
        for (axis, known) in Axis::ALL.into_iter().zip(&mut self.states) {
            let state = state(axis);
            if state != *known {
                *known = state;
                let _ = self.waiting.push_back(Note::Position { axis, state });
            }
        }
    }

    pub(crate) fn take(&mut self) -> Option<Note> {
        self.waiting.pop_front()
    }
}
