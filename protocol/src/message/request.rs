//! The table of requests.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{
    Axis, Codes, CoefficientBits, CorrectionInfo, LightLevels, LinkRate, Routine, SettingKey, Shot,
    ShotLight, SunQuery,
};
use crate::units::{Micros, Nanometres};

/// A request. Ids increase; the board answers a repeated id from memory and does not act again.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
#[allow(missing_docs, reason = "names and types describe these fields")]
pub enum Request {
    /// Identify the board. Changes nothing, needs no session or new id, and may carry boot number 0
    /// (unknown). Answer: [`super::Response::Hello`].
    Hello,
    /// Read the board's state. Answer: [`super::Response::Status`].
    Status,
    /// Home an axis: its home switch becomes position 0. Answer: [`super::Response::Accepted`]; ends with
    /// [`super::EventKind::Homed`] or [`super::EventKind::Failed`].
    Home {
        /// Axis with a home switch.
        axis: Axis,
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Move to an absolute position; other axes may move simultaneously. Answer:
    /// [`super::Response::Accepted`]; ends with [`super::EventKind::MoveDone`] or
    /// [`super::EventKind::Failed`].
    Move {
        axis: Axis,
        /// Target; refused, never clamped, outside of [`super::Hello::limits`].
        target: Nanometres,
        /// Silence deadline of the host, within [`super::Limits::silence_min`] and
        /// [`super::Limits::silence_max`]. After half of it the board sends [`super::EventKind::StillThere`],
        /// which any request of the session answers. At the deadline everything stops with
        /// [`super::Alarm::HostSilence`].
        silence: Micros,
    },
    /// Stop all motion along the ramps and end a running program. Answer: [`super::Response::Accepted`], also
    /// without motion; active work ends with [`super::EventKind::Failed`] and [`super::Failure::Stopped`].
    Stop,
    /// Load one shot; the program must be armed again. Refused while a program runs. Answer:
    /// [`super::Response::Accepted`].
    LoadShot {
        /// Index from 0, below [`super::Limits::shots_max`].
        index: u8,
        shot: Shot,
    },
    /// Run the armed program: move, settle, trigger and time-stamp each shot. It stays armed. Answer:
    /// [`super::Response::Accepted`]; ends with [`super::EventKind::ProgramDone`] or
    /// [`super::EventKind::Failed`].
    RunProgram {
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Read an event again after a gap in the numbers. Answer: [`super::Response::Event`].
    ReadEvent { number: u32 },
    /// Stop everything, answer, then reset. The boot number changes, so a repeat is refused. Answer:
    /// [`super::Response::Accepted`].
    Reboot,
    /// Emergency stop: the last STEP pulse comes within a millisecond, and a moving axis loses its position.
    /// Latches [`super::Alarm::Halt`]. Answer: [`super::Response::Accepted`].
    Halt,
    /// Check and arm shots 0 to `shots` - 1: all loaded, in range, axes homed. Answer:
    /// [`super::Response::Accepted`].
    ArmProgram { shots: u8 },
    /// Pause after the current exposure. Answer: [`super::Response::Accepted`]; [`super::EventKind::Paused`]
    /// follows.
    PauseProgram,
    /// Resume after a pause; the position settles again. Answer: [`super::Response::Accepted`].
    ResumeProgram,
    /// Calibrate the mechanics. Answer: [`super::Response::Accepted`]; ends with
    /// [`super::EventKind::Calibrated`] or [`super::EventKind::Failed`].
    Calibrate {
        routine: Routine,
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Read one of the last eight alarms. Answer: [`super::Response::Alarm`].
    ReadAlarm {
        /// Number; 0 = the last alarm.
        number: u32,
    },
    /// Clear the latched alarm. Answer: [`super::Response::Accepted`], or
    /// [`super::RequestError::AlarmRemains`] while its cause persists.
    ClearAlarm {
        /// Number: only a reported alarm can be cleared.
        number: u32,
    },
    /// Read a setting. Answer: [`super::Response::Setting`].
    ReadSetting { key: SettingKey },
    /// Change a setting permanently. Refused during motion. Answer: [`super::Response::Setting`].
    WriteSetting {
        key: SettingKey,
        /// New value, in the unit of the key's name.
        value: i32,
    },
    /// Read the lifetime counters. Answer: [`super::Response::Counters`].
    ReadCounters,
    /// Calculate the sun and a subject's shadow. Answer: [`super::Response::Sun`].
    Sun(SunQuery),
    /// Open an empty correction, to be filled by [`Request::PutCoefficients`] or [`Request::FitSamples`].
    /// Maths requests are refused with `Busy` while a stepper moves. Answer: [`super::Response::Accepted`].
    OpenCorrection(CorrectionInfo),
    /// Open the stored correction. Answer: [`super::Response::Correction`].
    LoadCorrection,
    /// Store the open correction permanently. Answer: [`super::Response::Accepted`].
    StoreCorrection,
    /// Set coefficients of the open correction. Answer: [`super::Response::Accepted`].
    PutCoefficients {
        /// Index of the first.
        first: u8,
        /// Q2.29 values.
        bits: CoefficientBits,
    },
    /// Read coefficients of the open correction. Answer: [`super::Response::Coefficients`].
    GetCoefficients {
        /// Index of the first.
        first: u8,
        /// At most [`super::COEFFICIENTS_MAX`].
        count: u8,
    },
    /// Add pixels of a flat target to the fit. Answer: [`super::Response::Accepted`].
    FitSamples {
        row: u16,
        /// Column of the first pixel.
        first: u16,
        /// Column step.
        step: u16,
        /// Code of the target's true depth.
        truth: i16,
        codes: Codes,
    },
    /// Solve the fit and put the coefficients into the open correction. Answer:
    /// [`super::Response::Accepted`].
    SolveFit,
    /// Write pixels to the row buffer. Answer: [`super::Response::Accepted`].
    PutRow {
        /// Column of the first pixel.
        first: u16,
        codes: Codes,
    },
    /// Correct the row buffer as this row of the map. Answer: [`super::Response::Accepted`].
    CorrectRow { row: u16 },
    /// Read pixels of the row buffer. Answer: [`super::Response::Row`].
    GetRow {
        /// Column of the first pixel.
        first: u16,
        /// At most [`super::CODES_MAX`].
        count: u8,
    },
    /// Open the session in the frame (not 0, best random) with a new id, see [`super::Hello::last_id`]. Work
    /// of the previous session ends as by [`Request::Stop`], its requests are refused. Answer:
    /// [`super::Response::Accepted`].
    OpenSession,
    /// Repeat the armed program endlessly: move, settle, trigger, time-stamp. Each period ends with
    /// [`super::EventKind::FrameTaken`] or [`super::EventKind::FrameDropped`]. Answer:
    /// [`super::Response::Accepted`]; ends with [`super::EventKind::ContinuousDone`] after `exposures`, or
    /// [`super::EventKind::Failed`].
    RunContinuously {
        /// Trigger period, exact to the microsecond; 0 = as fast as position and camera permit. Refused with
        /// [`super::RequestError::Period`] if shorter than exposure and read-out.
        period: Micros,
        /// Number of exposures; 0 = until stopped.
        exposures: u32,
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Change the link rate while idle; the answer still has the old rate. Without a valid request within
    /// [`super::LINK_TRIAL`] the board returns to the old rate; each reset starts with [`LinkRate::START`].
    /// Answer: [`super::Response::Accepted`].
    SetLinkRate { rate: LinkRate },
    /// Set the brightness of both light outputs. They go off after `time`, after `silence` without a request of the
    /// session, and with [`Request::Stop`], [`Request::OpenSession`], every alarm and every reset. Refused while an alarm is
    /// latched, except to switch both off. Answer: [`super::Response::Accepted`].
    SetLights {
        /// Brightness.
        levels: LightLevels,
        /// How long they may stay on, at most [`super::LIGHT_TIME_MAX`].
        time: Micros,
        /// How long the host may send nothing, within the limits of [`Request::Move`]. Expires without an alarm.
        silence: Micros,
    },
    /// Give a loaded shot a flash, or none. [`Request::LoadShot`] and a reset remove it. Refused while a program runs. Each
    /// flash is reported by [`super::EventKind::Flash`]. Answer: [`super::Response::Accepted`].
    SetShotLight {
        /// Place in the program.
        index: u8,
        /// The flash.
        light: Option<ShotLight>,
    },
}
