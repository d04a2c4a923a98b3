//! What the rig tells whoever reads the board's log: what changed, what it refused, what stopped it.
//!
//! The host is told all of it by answers, events and status; the log is for whoever looks afterwards, or while no host is there.

use farnear_protocol::BoardMicros;
use farnear_protocol::message::{AlarmRecord, Axis, LinkRate, PositionState, RequestError};
use heapless::Deque;

/// Notes that wait: one is taken in a tick. What finds no room is left out; the host is told all the same.
const WAITING: usize = 8;

/// A line of the log.
#[derive(Clone, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Note {
    /// A STEP queue ran dry; said once, until none is dry any more.
    StepQueueDry {
        /// When it was seen.
        time: BoardMicros,
    },
    /// The board is going to be reset, for the host asked for it.
    Reset,
    /// An alarm came up.
    Alarm(AlarmRecord),
    /// It was cleared.
    AlarmCleared {
        /// Its number.
        number: u32,
    },
    /// A request was refused.
    Refused {
        /// Its id.
        request: u32,
        /// Why.
        error: RequestError,
    },
    /// What is known of an axis' position changed.
    Position {
        /// The axis.
        axis: Axis,
        /// What is known now.
        state: PositionState,
    },
    /// A host opened a session.
    Session {
        /// With this request.
        request: u32,
    },
    /// The link has another rate from now on.
    LinkRate(LinkRate),
}

/// Notes that wait for the log.
#[derive(Clone, Debug)]
pub(crate) struct Notes {
    waiting: Deque<Note, WAITING>,
    /// What was known of the axes' positions when they were looked at last.
    states: [PositionState; Axis::ALL.len()],
}

impl Notes {
    /// Of a rig that was just reset.
    pub(crate) const fn new() -> Self {
        // The piezo's gauge is absolute.
        let states = [PositionState::Unknown, PositionState::Homed, PositionState::Unknown];
        Self { waiting: Deque::new(), states }
    }

    pub(crate) fn add(&mut self, note: Note) {
        let _ = self.waiting.push_back(note); // without room it is left out
    }

    /// Looks whether an axis is known otherwise than before.
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
