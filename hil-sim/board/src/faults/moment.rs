//! Moments of a run to which a fault can be tied.

use serde::{Deserialize, Serialize};

/// Something that happens in every run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Moment {
    /// A motor makes its first step after it has stood.
    MotionBegins,
    /// The camera begins to collect light.
    ExposureBegins,
    /// It stops, and reads out.
    ExposureEnds,
    /// The board begins to write its memory after 5 ms without a write.
    MemoryWrite,
    /// A request goes on the line to the board.
    Request,
    /// The board has given an answer.
    Answer,
    /// The board has said that it started.
    Started,
    /// The board has said that an axis is homed.
    Homed,
    /// The board has said that a move is done.
    MoveDone,
    /// The board has raised an alarm.
    Alarm,
}

impl Moment {
    pub const ALL: [Self; 10] = [
        Self::MotionBegins,
        Self::ExposureBegins,
        Self::ExposureEnds,
        Self::MemoryWrite,
        Self::Request,
        Self::Answer,
        Self::Started,
        Self::Homed,
        Self::MoveDone,
        Self::Alarm,
    ];
}
