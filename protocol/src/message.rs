//! The message table: everything host and board can say. The four tables are here; what their messages are made of
//! lies in one file per subject.
//!
//! Conventions: positions are [`Nanometres`], positive = sensor and lens away from each other (near focus lies on the
//! positive side); 0 = home switch; sensor distance = datum + coarse + fine + lens. Set-points are absolute, so a
//! request that arrives twice asks for nothing new. Moments are [`BoardMicros`]; durations [`Micros`].
//!
//! Growing the table: append variants and messages at the end; anything else is a new protocol version. The
//! bytes of version 2 are frozen in `tests/frozen_wire.rs`.

mod alarm;
mod axis;
mod board;
mod calibration;
mod maths;
mod memory;
mod shot;

use postcard_schema::{Schema, key::Key};
use serde::{Deserialize, Serialize};

pub use self::{
    alarm::{Alarm, AlarmRecord},
    axis::{Axis, AxisStatus, PositionState},
    board::{Capabilities, Hello, Limits, LinkCounters, ResetCause, Status},
    calibration::{Calibration, Routine},
    maths::{
        CODES_MAX, COEFFICIENTS_MAX, Codes, CoefficientBits, CorrectionFault, CorrectionForm, CorrectionInfo,
        QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
    },
    memory::{Counters, RecordName, Setting, SettingKey},
    shot::{ProgramState, ProgramStatus, Shot, ShotFault, ShotRecord, TriggerMode},
};
use crate::units::{BoardMicros, Micros, Nanometres};

/// What the host can ask. Each request carries an id; the board answers a repeated id with the remembered
/// answer and does not act again.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub enum Request {
    /// Who are you? Opens a session: the board forgets the request ids it remembers. The only request that may
    /// carry boot number 0 ("I do not know yet"). Answer: [`Response::Hello`].
    Hello,
    /// How are you? Answer: [`Response::Status`].
    Status,
    /// Find the home switch of an axis and make it position 0. Answer: [`Response::Accepted`]; ends with
    /// [`EventKind::Homed`] or [`EventKind::Failed`].
    Home {
        /// The axis; only axes with a home switch can be homed.
        axis: Axis,
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Go to an absolute position. Answer: [`Response::Accepted`]; ends with [`EventKind::MoveDone`] or
    /// [`EventKind::Failed`]. Other axes may move at the same time.
    Move {
        /// The axis that moves.
        axis: Axis,
        /// Where to; outside the limits of [`Hello::limits`] it is refused, never clamped.
        target: Nanometres,
        /// How long the host may say nothing while this is under way, within [`Limits::silence_min`] and
        /// [`Limits::silence_max`]. After half of it the board says [`EventKind::StillThere`]; any good frame answers
        /// that. After all of it everything stops with [`Alarm::HostSilence`].
        silence: Micros,
    },
    /// Stop all motion along the ramps and end a running program. Answer: [`Response::Accepted`], also when nothing moves; what
    /// was running ends with [`EventKind::Failed`] and [`Failure::Stopped`].
    Stop,
    /// Put one shot into the exposure program, which then must be armed again. Refused while a program runs. Answer:
    /// [`Response::Accepted`].
    LoadShot {
        /// Place in the program, from 0; at most [`Limits::shots_max`] - 1.
        index: u8,
        /// The shot.
        shot: Shot,
    },
    /// Run the armed program: move, settle, trigger, time-stamp, each shot in turn. Answer: [`Response::Accepted`];
    /// ends with [`EventKind::ProgramDone`] or [`EventKind::Failed`]. The program stays armed and may be run again.
    RunProgram {
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Send an event again (the host saw a gap in the event numbers). Answer: [`Response::Event`].
    ReadEvent {
        /// The event's number.
        number: u32,
    },
    /// Stop everything, answer, then reset. The next boot has another boot number, so a retry is refused.
    /// Answer: [`Response::Accepted`].
    Reboot,
    /// Emergency stop by the host: the last STEP pulse comes within a millisecond, and an axis that moved has lost its
    /// position. Latches [`Alarm::Halt`]. Answer: [`Response::Accepted`].
    Halt,
    /// Check the shots 0 to `shots` - 1 as a program: all loaded, inside the limits, axes homed. Answer:
    /// [`Response::Accepted`] and the program is armed.
    ArmProgram {
        /// How many of the loaded shots.
        shots: u8,
    },
    /// Stand still after the exposure that is under way. Answer: [`Response::Accepted`]; [`EventKind::Paused`] follows.
    PauseProgram,
    /// Go on after a pause; the position is settled anew. Answer: [`Response::Accepted`].
    ResumeProgram,
    /// Measure the mechanics. Answer: [`Response::Accepted`]; ends with [`EventKind::Calibrated`] or
    /// [`EventKind::Failed`].
    Calibrate {
        /// What.
        routine: Routine,
        /// How long the host may say nothing, see [`Request::Move`].
        silence: Micros,
    },
    /// Read a past alarm by its number (the last eight are kept). Answer: [`Response::Alarm`].
    ReadAlarm {
        /// Its number; 0 = the last.
        number: u32,
    },
    /// Clear the latched alarm. Answer: [`Response::Accepted`], or [`RequestError::AlarmRemains`] while its cause does.
    ClearAlarm {
        /// Its number: only what was read can be cleared.
        number: u32,
    },
    /// Read a setting. Answer: [`Response::Setting`].
    ReadSetting {
        /// Which.
        key: SettingKey,
    },
    /// Change a setting, now and for later boots. Refused while anything moves. Answer: [`Response::Setting`].
    WriteSetting {
        /// Which.
        key: SettingKey,
        /// Its new value, in the unit of its name.
        value: i32,
    },
    /// Read the counters of the board's life. Answer: [`Response::Counters`].
    ReadCounters,
    /// Where is the sun, and how does a subject's shadow lie? Answer: [`Response::Sun`].
    Sun(SunQuery),
    /// Begin an empty correction: coefficients come by [`Request::PutCoefficients`], or samples by
    /// [`Request::FitSamples`]. Maths requests are refused with `Busy` while a stepper moves. Answer:
    /// [`Response::Accepted`].
    OpenCorrection(CorrectionInfo),
    /// Take the stored correction as the open one. Answer: [`Response::Correction`].
    LoadCorrection,
    /// Keep the open correction without power. Answer: [`Response::Accepted`].
    StoreCorrection,
    /// Set some coefficients of the open correction. Answer: [`Response::Accepted`].
    PutCoefficients {
        /// Number of the first.
        first: u8,
        /// Their Q2.29 bits.
        bits: CoefficientBits,
    },
    /// Read some coefficients of the open correction. Answer: [`Response::Coefficients`].
    GetCoefficients {
        /// Number of the first.
        first: u8,
        /// How many, at most [`COEFFICIENTS_MAX`].
        count: u8,
    },
    /// Add pixels of a flat target to the fit of the open correction. Answer: [`Response::Accepted`].
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
    /// Solve the fit; its coefficients become those of the open correction. Answer: [`Response::Accepted`].
    SolveFit,
    /// Put pixels into the row buffer. Answer: [`Response::Accepted`].
    PutRow {
        /// Column of the first.
        first: u16,
        /// Codes of the depths.
        codes: Codes,
    },
    /// Correct the row buffer as this row of the map. Answer: [`Response::Accepted`].
    CorrectRow {
        /// Row of the depth map.
        row: u16,
    },
    /// Read pixels from the row buffer. Answer: [`Response::Row`].
    GetRow {
        /// Column of the first.
        first: u16,
        /// How many, at most [`CODES_MAX`].
        count: u8,
    },
}

/// The board's answer to a request it carried out or took on.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Debug)]
pub enum Response {
    /// Answer to [`Request::Hello`].
    Hello(Hello),
    /// Answer to [`Request::Status`].
    Status(Status),
    /// Done, or begun: long work ends with an event that names the request.
    Accepted,
    /// Answer to [`Request::ReadEvent`].
    Event(Event),
    /// Answer to [`Request::ReadAlarm`].
    Alarm(AlarmRecord),
    /// Answer to [`Request::ReadSetting`] and [`Request::WriteSetting`].
    Setting(Setting),
    /// Answer to [`Request::ReadCounters`].
    Counters(Counters),
    /// Answer to [`Request::Sun`].
    Sun(SunAnswer),
    /// Answer to [`Request::LoadCorrection`].
    Correction(CorrectionInfo),
    /// Answer to [`Request::GetCoefficients`].
    Coefficients(CoefficientBits),
    /// Answer to [`Request::GetRow`].
    Row(Codes),
}

/// Why the board did not do what was asked. Nothing has changed when one of these comes.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
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
    /// This id was used for another request in this session.
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
}

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
    /// Terminal event of [`Request::Home`].
    Homed {
        /// The request that this ends.
        request: u32,
        /// The axis.
        axis: Axis,
        /// How far the encoder's old zero was from the new one (0 at the first homing).
        shift: Nanometres,
    },
    /// Terminal event of [`Request::Move`].
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
    /// Terminal event of [`Request::RunProgram`].
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
    /// Terminal event of [`Request::Calibrate`].
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
    /// A shot of [`TriggerMode::Software`] is settled: trigger the camera now.
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
}

/// Why long work ended early.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Failure {
    /// The host asked for it with [`Request::Stop`] or [`Request::Reboot`].
    Stopped,
    /// The home switch did not close within the whole travel.
    HomeSwitchNotFound,
    /// The home switch did not open again.
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
    /// The camera's exposure-active signal did not come.
    NoStrobe,
    /// The driver reports a fault on its DIAG line.
    DriverFault,
    /// The step timer could not be fed in time; the position is now `Lost`.
    StepUnderrun,
    /// The gauge's converter answers nonsense (not connected, saturated).
    Gauge,
    /// An alarm stopped it; [`EventKind::Alarm`] names which.
    Alarm {
        /// The alarm's number.
        number: u32,
    },
    /// Backlash or piezo could not be measured: the readings contradict each other.
    Implausible,
}

/// A key of the whole message table: two programs with the same key agree on every byte of every message.
pub const SCHEMA_KEY: u64 = {
    let keys = [
        Key::for_path::<Request>("request").to_bytes(),
        Key::for_path::<Response>("response").to_bytes(),
        Key::for_path::<RequestError>("error").to_bytes(),
        Key::for_path::<Event>("event").to_bytes(),
    ];
    let mut sum = 0u64;
    let mut i = 0;
    while i < keys.len() {
        sum = sum.rotate_left(17) ^ u64::from_le_bytes(keys[i]);
        i += 1;
    }
    sum
};
