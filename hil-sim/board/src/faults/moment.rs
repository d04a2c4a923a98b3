//! Moments of a run that can trigger a fault.

use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Moment {
    /// First step of a motor after standstill.
    MotionBegins,
    ExposureBegins,
    ExposureEnds,
    /// The first write after 5 ms without one.
    MemoryWrite,
    Request,
    Answer,
    Started,
    Homed,
    MoveDone,
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
