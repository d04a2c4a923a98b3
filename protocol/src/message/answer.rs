//! Answers to requests: responses and errors.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{
    Alarm, AlarmRecord, Axis, Codes, CoefficientBits, CorrectionFault, CorrectionInfo, Counters, Event,
    Hello, LightFault, PositionState, ProgramState, Setting, ShotFault, Status, SunAnswer,
};
use crate::units::{Micros, Nanometres};

/// Answer to a request that was executed or accepted.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Debug)]
pub enum Response {
    Hello(Hello),
    Status(Status),
    /// Done or accepted: long work ends with an event that names the request.
    Accepted,
    Event(Event),
    Alarm(AlarmRecord),
    /// Answer to [`super::Request::ReadSetting`] and [`super::Request::WriteSetting`].
    Setting(Setting),
    Counters(Counters),
    Sun(SunAnswer),
    /// Answer to [`super::Request::LoadCorrection`].
    Correction(CorrectionInfo),
    Coefficients(CoefficientBits),
    Row(Codes),
}

/// Why a request was rejected. Nothing has changed.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RequestError {
    /// Unsupported frame version. This variant has the same bytes in all versions.
    Version { min: u8, current: u8 },
    /// The request was for another boot.
    Boot { current: u32 },
    /// The body is not a request of this version.
    Malformed,
    /// The id was used for another request.
    IdReused,
    /// Target outside the limits of the axis.
    OutOfRange { axis: Axis, asked: Nanometres, min: Nanometres, max: Nanometres },
    /// The axis must be homed first.
    NotHomed { axis: Axis, state: PositionState },
    /// Other work is active; stop it or wait for its end.
    Busy { request: u32 },
    /// The axis has no home switch.
    CannotHome { axis: Axis },
    /// Invalid shot or program.
    Shot { index: u8, reason: ShotFault },
    /// The event is not (or no longer) stored.
    EventGone {
        /// Oldest stored event.
        oldest: u32,
        next: u32,
    },
    /// A latched alarm must be cleared first.
    Alarm { number: u32, alarm: Alarm },
    /// No latched or stored alarm has this number.
    NoSuchAlarm {
        /// Number of the latched alarm, or 0.
        latched: u32,
        /// Number of the last alarm, or 0.
        last: u32,
    },
    /// The cause persists, so the alarm cannot be cleared.
    AlarmRemains { alarm: Alarm },
    /// Sensor and lens would come too close.
    TooClose {
        /// Smallest distance on the way.
        distance: Nanometres,
        min: Nanometres,
    },
    /// Silence deadline outside the limits.
    Silence { min: Micros, max: Micros },
    /// The program is in the wrong state.
    Program { state: ProgramState },
    /// Setting value out of range.
    SettingRange(Setting),
    /// Invalid depth correction.
    Correction(CorrectionFault),
    /// The axis does not exist on this board.
    NotFitted { axis: Axis },
    /// The axis has no such calibration routine.
    NoSuchRoutine,
    /// The session is not open: another host has opened one, or none is open.
    NotInSession,
    /// The id is old and its answer no longer stored; nothing was done.
    IdNotNew {
        /// Largest id so far; new ids exceed it by at most [`super::ID_STEP_MAX`].
        last: u32,
    },
    /// Too many outstanding requests. This one was ignored: repeat it.
    QueueFull { outstanding: u8 },
    /// Period shorter than the camera permits.
    Period {
        /// Longest exposure of the armed shots plus read-out.
        min: Micros,
    },
    /// The light cannot be set like this.
    Light { reason: LightFault },
}
