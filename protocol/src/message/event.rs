//! Events: spontaneous, or the end of long work.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{AlarmRecord, Axis, Calibration, DropReason, LightLevels, RecordName, ResetCause, ShotRecord};
use crate::units::{BoardMicros, Micros, Nanometres};

/// An event with the board's time. The frame's id is the event number, from 0 at each boot.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Event {
    pub time: BoardMicros,
    pub kind: EventKind,
}

/// Type and data of an event.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub enum EventKind {
    /// The board has started; always event 0.
    Started {
        cause: ResetCause,
    },
    /// End of [`super::Request::Home`].
    Homed {
        request: u32,
        axis: Axis,
        /// Change of the encoder's zero (0 at the first homing).
        shift: Nanometres,
    },
    /// End of [`super::Request::Move`].
    MoveDone {
        request: u32,
        axis: Axis,
        asked: Nanometres,
        /// Position by encoder or gauge.
        measured: Nanometres,
    },
    /// An exposure of a program is complete.
    ShotDone {
        request: u32,
        shot: ShotRecord,
    },
    /// End of [`super::Request::RunProgram`].
    ProgramDone {
        request: u32,
        exposures: u16,
    },
    /// Long work ended without success; its motion has stopped.
    Failed {
        request: u32,
        axis: Option<Axis>,
        reason: Failure,
    },
    /// End of [`super::Request::Calibrate`].
    Calibrated {
        request: u32,
        result: Calibration,
    },
    /// An alarm was raised and latched.
    Alarm(AlarmRecord),
    AlarmCleared {
        number: u32,
    },
    /// Half of the silence deadline has passed: send a request.
    StillThere {
        /// Request with the deadline.
        request: u32,
    },
    /// A shot of [`super::TriggerMode::Software`] has settled: trigger the camera.
    ShotReady {
        request: u32,
        index: u8,
        /// Repeat of the shot, from 0.
        repeat: u16,
        trigger_number: u32,
        exposure: Micros,
    },
    /// The program is paused between two exposures.
    Paused {
        request: u32,
        /// Index of the shot that is next.
        index: u8,
    },
    /// A damaged copy of a record was replaced by the other one.
    RecordRepaired {
        record: RecordName,
        /// Version of the copy in use.
        sequence: u32,
    },
    /// An exposure of a continuous run is complete.
    FrameTaken {
        request: u32,
        /// Period number, from 0; each period has one event.
        frame: u32,
        /// Largest deviation from the target during the exposure; beyond the shot's settle window the sensor moved.
        deviation: Nanometres,
        shot: ShotRecord,
    },
    /// A period of a continuous run had no exposure; the same shot is due next.
    FrameDropped {
        request: u32,
        /// Period number, from 0.
        frame: u32,
        index: u8,
        reason: DropReason,
    },
    /// End of [`super::Request::RunContinuously`] with a number of exposures.
    ContinuousDone {
        request: u32,
        exposures: u32,
        dropped: u32,
    },
    /// The flash of an exposure; follows its [`EventKind::ShotDone`] or [`EventKind::FrameTaken`].
    Flash {
        /// The request that runs the program.
        request: u32,
        /// The exposure's [`ShotRecord::trigger_number`].
        trigger_number: u32,
        levels: LightLevels,
        on: BoardMicros,
        off: BoardMicros,
    },
}

impl EventKind {
    /// The request whose work ends with this event.
    pub const fn ended(&self) -> Option<u32> {
        match self {
            Self::Homed { request, .. }
            | Self::MoveDone { request, .. }
            | Self::ProgramDone { request, .. }
            | Self::ContinuousDone { request, .. }
            | Self::Calibrated { request, .. }
            | Self::Failed { request, .. } => Some(*request),
            Self::Started { .. }
            | Self::ShotDone { .. }
            | Self::Alarm(_)
            | Self::AlarmCleared { .. }
            | Self::StillThere { .. }
            | Self::ShotReady { .. }
            | Self::Paused { .. }
            | Self::RecordRepaired { .. }
            | Self::FrameTaken { .. }
            | Self::FrameDropped { .. }
            | Self::Flash { .. } => None,
        }
    }
}

/// Why long work failed.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Failure {
    /// [`super::Request::Stop`] or [`super::Request::Reboot`].
    Stopped,
    /// Home switch not closed within the travel.
    HomeSwitchNotFound,
    /// Home switch stuck closed, or opened elsewhere than it closed.
    HomeSwitchStuck,
    /// Far switch closed during a move.
    FarSwitch,
    /// Home switch closed during a move away from it or far from 0.
    HomeSwitch,
    /// Encoder off the commanded position: stall or slip. The position is now `Lost`.
    Following {
        /// Commanded minus measured.
        error: Nanometres,
    },
    /// The position did not settle in time.
    NotSettled {
        /// Target minus measured at the timeout.
        error: Nanometres,
    },
    /// No exposure signal of the camera, or one more than 0.1 ms shorter than the trigger pulse.
    NoStrobe,
    /// Fault on the driver's DIAG line.
    DriverFault,
    /// Step timer underrun; the position is now `Lost`.
    StepUnderrun,
    /// Invalid gauge data (disconnected, saturated), or the piezo does not follow.
    Gauge,
    /// Stopped by an alarm, see [`EventKind::Alarm`].
    Alarm { number: u32 },
    /// Contradictory readings of a calibration.
    Implausible,
}
