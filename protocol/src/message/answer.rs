//! What the board answers to a request: a response, or why it refuses.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{
    Alarm, AlarmRecord, Axis, Codes, CoefficientBits, CorrectionFault, CorrectionInfo, Counters, Event,
    Hello, LightFault, PositionState, ProgramState, Setting, ShotFault, Status, SunAnswer,
};
use crate::units::{Micros, Nanometres};

/// The board's answer to a request it carried out or took on.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Debug)]
pub enum Response {
    /// Answer to [`super::Request::Hello`].
    Hello(Hello),
    /// Answer to [`super::Request::Status`].
    Status(Status),
    /// Done, or begun: long work ends with an event that names the request.
    Accepted,
    /// Answer to [`super::Request::ReadEvent`].
    Event(Event),
    /// Answer to [`super::Request::ReadAlarm`].
    Alarm(AlarmRecord),
    /// Answer to [`super::Request::ReadSetting`] and [`super::Request::WriteSetting`].
    Setting(Setting),
    /// Answer to [`super::Request::ReadCounters`].
    Counters(Counters),
    /// Answer to [`super::Request::Sun`].
    Sun(SunAnswer),
    /// Answer to [`super::Request::LoadCorrection`].
    Correction(CorrectionInfo),
    /// Answer to [`super::Request::GetCoefficients`].
    Coefficients(CoefficientBits),
    /// Answer to [`super::Request::GetRow`].
    Row(Codes),
}

/// Why the board did not do what was asked. Nothing has changed when one of these comes.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RequestError {
    /// The frame's version is not spoken here. This variant keeps its bytes in all versions.
    Version {
        /// Oldest version the board speaks.
        min: u8,
        /// Newest version the board speaks.
        current: u8,
    },
    /// The request was made for another boot of the board.
    Boot {
        /// The present boot number.
        current: u32,
    },
    /// The body is no request of this version.
    Malformed,
    /// This id was used for another request.
    IdReused,
    /// The position lies outside the axis' limits.
    OutOfRange {
        /// The axis.
        axis: Axis,
        /// What was asked.
        asked: Nanometres,
        /// Smallest position allowed.
        min: Nanometres,
        /// Largest position allowed.
        max: Nanometres,
    },
    /// The axis must be homed first.
    NotHomed {
        /// The axis.
        axis: Axis,
        /// Its state.
        state: PositionState,
    },
    /// Something else is under way; stop it or wait for its end.
    Busy {
        /// The request that is under way.
        request: u32,
    },
    /// The axis has no home switch, so it cannot be homed.
    CannotHome {
        /// The axis.
        axis: Axis,
    },
    /// A shot or a program is not possible.
    Shot {
        /// Place in the program.
        index: u8,
        /// What is wrong with it.
        reason: ShotFault,
    },
    /// The event is no longer (or not yet) known.
    EventGone {
        /// The oldest event that can be read.
        oldest: u32,
        /// The number the next event will get.
        next: u32,
    },
    /// An alarm is latched: clear it first.
    Alarm {
        /// Its number.
        number: u32,
        /// What it is.
        alarm: Alarm,
    },
    /// No alarm with this number is latched, or kept.
    NoSuchAlarm {
        /// The latched one, or 0.
        latched: u32,
        /// The number of the last alarm, or 0.
        last: u32,
    },
    /// The alarm's cause is still there, so it cannot be cleared.
    AlarmRemains {
        /// What it is.
        alarm: Alarm,
    },
    /// Sensor and lens would come too close to each other.
    TooClose {
        /// Their smallest distance on the way.
        distance: Nanometres,
        /// The smallest allowed.
        min: Nanometres,
    },
    /// The deadline for the host's silence is outside what the board allows.
    Silence {
        /// Shortest.
        min: Micros,
        /// Longest.
        max: Micros,
    },
    /// The program is in another state than the request needs.
    Program {
        /// Its state.
        state: ProgramState,
    },
    /// The setting's value is not allowed.
    SettingRange(Setting),
    /// A depth correction is not possible.
    Correction(CorrectionFault),
    /// The board has not this part.
    NotFitted {
        /// The axis.
        axis: Axis,
    },
    /// The calibration routine is not possible on this axis.
    NoSuchRoutine,
    /// The request's session is not the one that is open: another host has opened one since, or none is open yet.
    NotInSession,
    /// The id is not new, and its answer, where there was one, is no longer remembered. Nothing was done now.
    IdNotNew {
        /// The largest id so far. New ids go on from here, by at most [`super::ID_STEP_MAX`] at a time.
        last: u32,
    },
    /// More requests wait for their answers than the board can hold. This one was not looked at: repeat it.
    QueueFull {
        /// How many may wait.
        outstanding: u8,
    },
    /// The pace of a continuous run is faster than the camera.
    Period {
        /// The longest exposure of the armed shots and the camera's read-out.
        min: Micros,
    },
    /// The light cannot be set like this.
    Light {
        /// Why.
        reason: LightFault,
    },
}
