//! The table of requests.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{
    Axis, Codes, CoefficientBits, CorrectionInfo, LightLevels, LinkRate, Routine, SettingKey, Shot,
    ShotLight, SunQuery,
};
use crate::units::{Micros, Nanometres};

/// A request. Ids increase; the board answers a repeated id from memory and does not act again. Unless a variant names
/// another answer, the answer is [`super::Response::Accepted`]; long work that fails ends with
/// [`super::EventKind::Failed`].
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub enum Request {
    /// Identify the board. Needs no session or new id; boot number 0 (unknown) is valid. Answer:
    /// [`super::Response::Hello`].
    Hello,
    /// Read the board's state. Answer: [`super::Response::Status`].
    Status,
    /// Home an axis: its home switch becomes position 0. Ends with [`super::EventKind::Homed`].
    Home {
        axis: Axis,
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Move to an absolute position; other axes may move simultaneously. Ends with [`super::EventKind::MoveDone`].
    Move {
        axis: Axis,
        /// Target; rejected, never clamped, outside of [`super::Hello::limits`].
        target: Nanometres,
        /// Silence deadline of the host, within [`super::Limits::silence_min`] and [`super::Limits::silence_max`].
        /// After half of it the board sends [`super::EventKind::StillThere`], which any request of the session answers.
        /// At the deadline everything stops with [`super::Alarm::HostSilence`].
        silence: Micros,
    },
    /// Stop all motion along the ramps and end a running program. Accepted also without motion; active work ends with
    /// [`super::EventKind::Failed`] and [`super::Failure::Stopped`].
    Stop,
    /// Load one shot; the program must be armed again. Rejected while a program runs.
    LoadShot {
        /// Index from 0, below [`super::Limits::shots_max`].
        index: u8,
        shot: Shot,
    },
    /// Run the armed program, which stays armed: move, settle, trigger and time-stamp each shot. Ends with
    /// [`super::EventKind::ProgramDone`].
    RunProgram {
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Read an event again after a gap in the numbers. Answer: [`super::Response::Event`].
    ReadEvent { number: u32 },
    /// Stop everything, answer, then reset. The boot number changes, so a repeat is rejected.
    Reboot,
    /// Emergency stop: STEP pulses end within a millisecond; moving axes lose their position. Latches
    /// [`super::Alarm::Halt`].
    Halt,
    /// Check and arm shots 0 to `shots` - 1: all loaded, in range, axes homed.
    ArmProgram { shots: u8 },
    /// Pause after the current exposure; [`super::EventKind::Paused`] follows.
    PauseProgram,
    /// Resume after a pause; the position settles again.
    ResumeProgram,
    /// Calibrate the mechanics. Ends with [`super::EventKind::Calibrated`].
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
    /// Clear the latched alarm. [`super::RequestError::AlarmRemains`] while its cause persists.
    ClearAlarm {
        /// Number: only a reported alarm can be cleared.
        number: u32,
    },
    /// Read a setting. Answer: [`super::Response::Setting`].
    ReadSetting { key: SettingKey },
    /// Change a setting permanently. Rejected during motion. Answer: [`super::Response::Setting`].
    WriteSetting {
        key: SettingKey,
        /// New value, in the unit of the key's name.
        value: i32,
    },
    /// Read the lifetime counters. Answer: [`super::Response::Counters`].
    ReadCounters,
    /// Calculate the sun and a subject's shadow. Answer: [`super::Response::Sun`].
    Sun(SunQuery),
    /// Open an empty correction, to be filled by [`Request::PutCoefficients`] or [`Request::FitSamples`]. Maths
    /// requests are rejected with `Busy` while a stepper moves.
    OpenCorrection(CorrectionInfo),
    /// Open the stored correction. Answer: [`super::Response::Correction`].
    LoadCorrection,
    /// Store the open correction permanently.
    StoreCorrection,
    /// Set coefficients of the open correction.
    PutCoefficients {
        /// Index of the first coefficient.
        first: u8,
        bits: CoefficientBits,
    },
    /// Read coefficients of the open correction. Answer: [`super::Response::Coefficients`].
    GetCoefficients {
        /// Index of the first coefficient.
        first: u8,
        /// At most [`super::COEFFICIENTS_MAX`].
        count: u8,
    },
    /// Add pixels of a flat target to the fit.
    FitSamples {
        row: u16,
        /// Column of the first pixel.
        first: u16,
        /// Columns from one pixel to the next.
        step: u16,
        /// Code of the target's true depth.
        truth: i16,
        codes: Codes,
    },
    /// Solve the fit and put the coefficients into the open correction.
    SolveFit,
    /// Write pixels to the row buffer.
    PutRow {
        /// Column of the first pixel.
        first: u16,
        codes: Codes,
    },
    /// Correct the row buffer as this row of the map.
    CorrectRow { row: u16 },
    /// Read pixels of the row buffer. Answer: [`super::Response::Row`].
    GetRow {
        /// Column of the first pixel.
        first: u16,
        /// At most [`super::CODES_MAX`].
        count: u8,
    },
    /// Open the session in the frame (not 0, best random) with a new id, see [`super::Hello::last_id`]. Work of the
    /// previous session ends as by [`Request::Stop`], its requests are rejected.
    OpenSession,
    /// Repeat the armed program endlessly: move, settle, trigger, time-stamp. Each period ends with
    /// [`super::EventKind::FrameTaken`] or [`super::EventKind::FrameDropped`]; ends with
    /// [`super::EventKind::ContinuousDone`] after `exposures`.
    RunContinuously {
        /// Trigger period, exact to the microsecond; 0 = as fast as position and camera permit. Rejected with
        /// [`super::RequestError::Period`] if shorter than exposure and read-out.
        period: Micros,
        /// Number of exposures; 0 = until stopped.
        exposures: u32,
        /// Silence deadline, see [`Request::Move`].
        silence: Micros,
    },
    /// Change the link rate while idle; the answer still has the old rate. Without a valid request within
    /// [`super::LINK_TRIAL`] the board returns to the old rate; each reset starts with [`LinkRate::START`].
    SetLinkRate { rate: LinkRate },
    /// Set the brightness of both light outputs. They go off after `time`, after `silence` without a request of the
    /// session, and with [`Request::Stop`], [`Request::OpenSession`], every alarm and every reset. Rejected while an
    /// alarm is latched, except to switch both off.
    SetLights {
        levels: LightLevels,
        /// Limit of the on time, at most [`super::LIGHT_TIME_MAX`].
        time: Micros,
        /// Silence deadline, within the limits of [`Request::Move`]. Expires without an alarm.
        silence: Micros,
    },
    /// Give a loaded shot a flash, or none. [`Request::LoadShot`] and a reset remove it. Rejected while a program runs.
    /// Each flash is reported by [`super::EventKind::Flash`].
    SetShotLight {
        /// Place in the program.
        index: u8,
        light: Option<ShotLight>,
    },
}
