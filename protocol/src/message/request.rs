//! What the host can ask: the table of requests.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{Axis, Codes, CoefficientBits, CorrectionInfo, LightLevels, LinkRate, Routine, SettingKey, Shot, ShotLight, SunQuery};
use crate::units::{Micros, Nanometres};

/// What the host can ask. Each request carries an id, larger than all before it; the board answers a repeated id with
/// the remembered answer and does not act again.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub enum Request {
    /// Who are you? Changes nothing, needs no session and no new id. The only request that may
    /// carry boot number 0 ("I do not know yet"). Answer: [`super::Response::Hello`].
    Hello,
    /// How are you? Answer: [`super::Response::Status`].
    Status,
    /// Find the home switch of an axis and make it position 0. Answer: [`super::Response::Accepted`]; ends with
    /// [`super::EventKind::Homed`] or [`super::EventKind::Failed`].
    Home {
        /// The axis; only axes with a home switch can be homed.
        axis: Axis,
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Go to an absolute position. Answer: [`super::Response::Accepted`]; ends with [`super::EventKind::MoveDone`] or
    /// [`super::EventKind::Failed`]. Other axes may move at the same time.
    Move {
        /// The axis that moves.
        axis: Axis,
        /// Where to; outside the limits of [`super::Hello::limits`] it is refused, never clamped.
        target: Nanometres,
        /// How long the host may say nothing while this is under way, within [`super::Limits::silence_min`] and
        /// [`super::Limits::silence_max`]. After half of it the board says [`super::EventKind::StillThere`]; any request of
        /// the session answers that. After all of it everything stops with [`super::Alarm::HostSilence`].
        silence: Micros,
    },
    /// Stop all motion along the ramps and end a running program. Answer: [`super::Response::Accepted`], also when nothing moves; what
    /// was running ends with [`super::EventKind::Failed`] and [`super::Failure::Stopped`].
    Stop,
    /// Put one shot into the exposure program, which then must be armed again. Refused while a program runs. Answer:
    /// [`super::Response::Accepted`].
    LoadShot {
        /// Place in the program, from 0; at most [`super::Limits::shots_max`] - 1.
        index: u8,
        /// The shot.
        shot: Shot,
    },
    /// Run the armed program: move, settle, trigger, time-stamp, each shot in turn. Answer: [`super::Response::Accepted`];
    /// ends with [`super::EventKind::ProgramDone`] or [`super::EventKind::Failed`]. The program stays armed and may be run again.
    RunProgram {
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Send an event again (the host saw a gap in the event numbers). Answer: [`super::Response::Event`].
    ReadEvent {
        /// The event's number.
        number: u32,
    },
    /// Stop everything, answer, then reset. The next boot has another boot number, so a retry is refused.
    /// Answer: [`super::Response::Accepted`].
    Reboot,
    /// Emergency stop by the host: the last STEP pulse comes within a millisecond, and an axis that moved has lost its
    /// position. Latches [`super::Alarm::Halt`]. Answer: [`super::Response::Accepted`].
    Halt,
    /// Check the shots 0 to `shots` - 1 as a program: all loaded, inside the limits, axes homed. Answer:
    /// [`super::Response::Accepted`] and the program is armed.
    ArmProgram {
        /// How many of the loaded shots.
        shots: u8,
    },
    /// Stand still after the exposure that is under way. Answer: [`super::Response::Accepted`]; [`super::EventKind::Paused`] follows.
    PauseProgram,
    /// Go on after a pause; the position is settled anew. Answer: [`super::Response::Accepted`].
    ResumeProgram,
    /// Measure the mechanics. Answer: [`super::Response::Accepted`]; ends with [`super::EventKind::Calibrated`] or
    /// [`super::EventKind::Failed`].
    Calibrate {
        /// What.
        routine: Routine,
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Read a past alarm by its number (the last eight are kept). Answer: [`super::Response::Alarm`].
    ReadAlarm {
        /// Its number; 0 = the last.
        number: u32,
    },
    /// Clear the latched alarm. Answer: [`super::Response::Accepted`], or [`super::RequestError::AlarmRemains`] while its cause does.
    ClearAlarm {
        /// Its number: only what was read can be cleared.
        number: u32,
    },
    /// Read a setting. Answer: [`super::Response::Setting`].
    ReadSetting {
        /// Which.
        key: SettingKey,
    },
    /// Change a setting, now and for later boots. Refused while anything moves. Answer: [`super::Response::Setting`].
    WriteSetting {
        /// Which.
        key: SettingKey,
        /// Its new value, in the unit of its name.
        value: i32,
    },
    /// Read the counters of the board's life. Answer: [`super::Response::Counters`].
    ReadCounters,
    /// Where is the sun, and how does a subject's shadow lie? Answer: [`super::Response::Sun`].
    Sun(SunQuery),
    /// Begin an empty correction: coefficients come by [`Request::PutCoefficients`], or samples by
    /// [`Request::FitSamples`]. Maths requests are refused with `Busy` while a stepper moves. Answer:
    /// [`super::Response::Accepted`].
    OpenCorrection(CorrectionInfo),
    /// Take the stored correction as the open one. Answer: [`super::Response::Correction`].
    LoadCorrection,
    /// Keep the open correction without power. Answer: [`super::Response::Accepted`].
    StoreCorrection,
    /// Set some coefficients of the open correction. Answer: [`super::Response::Accepted`].
    PutCoefficients {
        /// Number of the first.
        first: u8,
        /// Their Q2.29 bits.
        bits: CoefficientBits,
    },
    /// Read some coefficients of the open correction. Answer: [`super::Response::Coefficients`].
    GetCoefficients {
        /// Number of the first.
        first: u8,
        /// How many, at most [`super::COEFFICIENTS_MAX`].
        count: u8,
    },
    /// Add pixels of a flat target to the fit of the open correction. Answer: [`super::Response::Accepted`].
    FitSamples {
        /// Row of the depth map.
        row: u16,
        /// Column of the first pixel.
        first: u16,
        /// From one pixel to the next.
        step: u16,
        /// Code of the target's true depth.
        truth: i16,
        /// Codes of the depths.
        codes: Codes,
    },
    /// Solve the fit; its coefficients become those of the open correction. Answer: [`super::Response::Accepted`].
    SolveFit,
    /// Put pixels into the row buffer. Answer: [`super::Response::Accepted`].
    PutRow {
        /// Column of the first.
        first: u16,
        /// Codes of the depths.
        codes: Codes,
    },
    /// Correct the row buffer as this row of the map. Answer: [`super::Response::Accepted`].
    CorrectRow {
        /// Row of the depth map.
        row: u16,
    },
    /// Read pixels from the row buffer. Answer: [`super::Response::Row`].
    GetRow {
        /// Column of the first.
        first: u16,
        /// How many, at most [`super::CODES_MAX`].
        count: u8,
    },
    /// Open the session whose number the frame carries, any number but 0, best drawn at random; its id must be new, see
    /// [`super::Hello::last_id`]. What the session before had begun ends as by [`Request::Stop`], and its requests are
    /// refused from now on. Answer: [`super::Response::Accepted`].
    OpenSession,
    /// Run the armed program again and again, from its last shot to its first: move, settle, trigger, time-stamp. Each exposure is
    /// told by [`super::EventKind::FrameTaken`], each moment of the pace without one by [`super::EventKind::FrameDropped`]. Answer:
    /// [`super::Response::Accepted`]; ends with [`super::EventKind::ContinuousDone`] after so many exposures, with
    /// [`super::EventKind::Failed`] where it is stopped or breaks.
    RunContinuously {
        /// From one trigger to the next, to the microsecond; 0 = each exposure as soon as position and camera are ready. At least
        /// the longest exposure and the camera's read-out, else refused with [`super::RequestError::Period`].
        period: Micros,
        /// Exposures after which it ends; 0 = none, it goes on until it is stopped.
        exposures: u32,
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Change the link's rate, while nothing is under way: the answer still comes at the old one. Where no good request comes in
    /// at the new one within [`super::LINK_TRIAL`], the board goes back; each reset begins with [`LinkRate::START`]. Answer:
    /// [`super::Response::Accepted`].
    SetLinkRate {
        /// The new rate.
        rate: LinkRate,
    },
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
