//! What happens on the board by itself, or at the end of long work.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{AlarmRecord, Axis, Calibration, DropReason, LightLevels, RecordName, ResetCause, ShotRecord};
use crate::units::{BoardMicros, Micros, Nanometres};

/// Something that happened, with the board's time. Events are numbered from 0 at each boot; the number travels
/// in the frame's id field.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Event {
    /// When.
    pub time: BoardMicros,
    /// What.
    pub kind: EventKind,
}

/// What happened.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub enum EventKind {
    /// The board has started; event 0 of every boot.
    Started {
        /// Why it was reset.
        cause: ResetCause,
    },
    /// Terminal event of [`super::Request::Home`].
    Homed {
        /// The request that this ends.
        request: u32,
        /// The axis.
        axis: Axis,
        /// How far the encoder's old zero was from the new one (0 at the first homing).
        shift: Nanometres,
    },
    /// Terminal event of [`super::Request::Move`].
    MoveDone {
        /// The request that this ends.
        request: u32,
        /// The axis.
        axis: Axis,
        /// Where it was sent.
        asked: Nanometres,
        /// Where the encoder or gauge says it is.
        measured: Nanometres,
    },
    /// One exposure of a program was taken.
    ShotDone {
        /// The request that runs the program.
        request: u32,
        /// What was measured.
        shot: ShotRecord,
    },
    /// Terminal event of [`super::Request::RunProgram`].
    ProgramDone {
        /// The request that this ends.
        request: u32,
        /// Exposures taken.
        exposures: u16,
    },
    /// Terminal event of any long work that did not reach its end. Its motion has stopped.
    Failed {
        /// The request that this ends.
        request: u32,
        /// The axis concerned, if one is.
        axis: Option<Axis>,
        /// Why.
        reason: Failure,
    },
    /// Terminal event of [`super::Request::Calibrate`].
    Calibrated {
        /// The request that this ends.
        request: u32,
        /// What was found.
        result: Calibration,
    },
    /// An alarm came up and is latched.
    Alarm(AlarmRecord),
    /// The alarm was cleared.
    AlarmCleared {
        /// Its number.
        number: u32,
    },
    /// Half of the host's silence deadline has passed: say something.
    StillThere {
        /// The request with the deadline.
        request: u32,
    },
    /// A shot of [`super::TriggerMode::Software`] is settled: trigger the camera now.
    ShotReady {
        /// The request that runs the program.
        request: u32,
        /// Place in the program.
        index: u8,
        /// Which of the repeats, from 0.
        repeat: u16,
        /// The number that the exposure will have.
        trigger_number: u32,
        /// The exposure that the shot asks for.
        exposure: Micros,
    },
    /// The program stands between two exposures.
    Paused {
        /// The request that runs the program.
        request: u32,
        /// The shot that comes next.
        index: u8,
    },
    /// A copy of a record was bad at the start, and the other one is in use.
    RecordRepaired {
        /// Which.
        record: RecordName,
        /// The version of the copy in use.
        sequence: u32,
    },
    /// One exposure of a continuous run was taken.
    FrameTaken {
        /// The request that runs the program.
        request: u32,
        /// Which moment of the pace, from 0; one more than that of the event before, for each has its own event.
        frame: u32,
        /// Largest distance of the measured position from the one asked for, from the trigger's order to the end of the exposure;
        /// beyond the shot's settle window the picture was taken of a position that moved.
        deviation: Nanometres,
        /// What was measured.
        shot: ShotRecord,
    },
    /// A moment of a continuous run's pace passed without an exposure; the same shot is due at the next.
    FrameDropped {
        /// The request that runs the program.
        request: u32,
        /// Which moment of the pace, from 0.
        frame: u32,
        /// Place of the shot in the program.
        index: u8,
        /// Why.
        reason: DropReason,
    },
    /// Terminal event of [`super::Request::RunContinuously`] with a number of exposures.
    ContinuousDone {
        /// The request that this ends.
        request: u32,
        /// Exposures taken.
        exposures: u32,
        /// Frames dropped.
        dropped: u32,
    },
    /// The flash of an exposure; follows its [`EventKind::ShotDone`] or [`EventKind::FrameTaken`].
    Flash {
        /// The request that runs the program.
        request: u32,
        /// The exposure's [`ShotRecord::trigger_number`].
        trigger_number: u32,
        /// Brightness.
        levels: LightLevels,
        /// Start of the flash.
        on: BoardMicros,
        /// End of the flash.
        off: BoardMicros,
    },
}

/// Why long work ended early.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Failure {
    /// The host asked for it with [`super::Request::Stop`] or [`super::Request::Reboot`].
    Stopped,
    /// The home switch did not close within the whole travel.
    HomeSwitchNotFound,
    /// The home switch did not open again, or not where it closes.
    HomeSwitchStuck,
    /// The far switch closed during a move.
    FarSwitch,
    /// The home switch closed during a move away from it or far from position 0.
    HomeSwitch,
    /// The encoder is this far from the commanded position: stall or slip. The position is now `Lost`.
    Following {
        /// Commanded minus measured.
        error: Nanometres,
    },
    /// The position did not stay inside the settle window in time.
    NotSettled {
        /// Asked minus measured when time was up.
        error: Nanometres,
    },
    /// The camera's exposure-active signal did not come, or was more than 0.1 ms shorter than the trigger's pulse.
    NoStrobe,
    /// The driver reports a fault on its DIAG line.
    DriverFault,
    /// The step timer could not be fed in time; the position is now `Lost`.
    StepUnderrun,
    /// The gauge's converter answers nonsense (not connected, saturated), or the piezo does not follow.
    Gauge,
    /// An alarm stopped it; [`EventKind::Alarm`] names which.
    Alarm {
        /// The alarm's number.
        number: u32,
    },
    /// Backlash or piezo could not be measured: the readings contradict each other.
    Implausible,
}
