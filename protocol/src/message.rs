//! The message table: everything host and board can say, in one place.
//!
//! Conventions: positions are [`Nanometres`], positive = sensor away from the lens (near focus lies on the
//! positive side); coarse 0 = home switch; sensor distance = datum + coarse + fine. Set-points are absolute, so
//! a request that arrives twice asks for nothing new. Moments are [`BoardMicros`]; durations [`Micros`].
//!
//! Growing the table: append variants and messages at the end; anything else is a new protocol version. The
//! bytes of version 1 are frozen in `tests/frozen_wire.rs`.

use heapless::String;
use postcard_schema::{Schema, key::Key};
use serde::{Deserialize, Serialize};

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
    },
    /// Go to an absolute position. Answer: [`Response::Accepted`]; ends with [`EventKind::MoveDone`] or
    /// [`EventKind::Failed`].
    Move {
        /// The axis that moves.
        axis: Axis,
        /// Where to; outside the limits of [`Hello::limits`] it is refused, never clamped.
        target: Nanometres,
    },
    /// Stop all motion and end a running program. Answer: [`Response::Accepted`], also when nothing moves; what
    /// was running ends with [`EventKind::Failed`] and [`Failure::Stopped`].
    Stop,
    /// Put one shot into the exposure program. Refused while a program runs. Answer: [`Response::Accepted`].
    LoadShot {
        /// Place in the program, from 0; at most [`Limits::shots_max`] - 1.
        index: u8,
        /// The shot.
        shot: Shot,
    },
    /// Run the shots 0 to `shots` - 1: move, settle, trigger, time-stamp, each in turn. Answer:
    /// [`Response::Accepted`]; ends with [`EventKind::ProgramDone`] or [`EventKind::Failed`].
    RunProgram {
        /// How many of the loaded shots to run.
        shots: u8,
    },
    /// Send an event again (the host saw a gap in the event numbers). Answer: [`Response::Event`].
    ReadEvent {
        /// The event's number.
        number: u32,
    },
    /// Stop everything, answer, then reset. The next boot has another boot number, so a retry is refused.
    /// Answer: [`Response::Accepted`].
    Reboot,
}

/// The board's answer to a request it carried out or took on.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub enum Response {
    /// Answer to [`Request::Hello`].
    Hello(Hello),
    /// Answer to [`Request::Status`].
    Status(Status),
    /// Done, or begun: long work ends with an event that names the request.
    Accepted,
    /// Answer to [`Request::ReadEvent`].
    Event(Event),
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
}

/// What is wrong with a shot.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ShotFault {
    /// The index is not below [`Limits::shots_max`], or the program has no shots.
    Index,
    /// This shot of the program was never loaded.
    Missing,
    /// The exposure is outside [`Limits::exposure_min`] to [`Limits::exposure_max`].
    Exposure,
    /// The settle window or its dwell time is 0 or larger than the board can watch.
    Settle,
    /// The repeat count is 0.
    Repeat,
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
    /// Terminal event of any long work that did not reach its end. All motion has stopped.
    Failed {
        /// The request that this ends.
        request: u32,
        /// The axis concerned, if one is.
        axis: Option<Axis>,
        /// Why.
        reason: Failure,
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
}

/// A movable part of the rig.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Axis {
    /// Stage A's stepper and screw, 0 at the home switch.
    SensorCoarse,
    /// Stage A's piezo, 0 = relaxed, as its strain gauge measures it.
    SensorFine,
}

/// What is known of an axis' position.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum PositionState {
    /// Never homed since the reset.
    Unknown,
    /// Homed, and steps and encoder have agreed since.
    Homed,
    /// Was homed, but steps and encoder disagree: home again.
    Lost,
}

/// One entry of an exposure program.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shot {
    /// The axis to move before the exposure.
    pub axis: Axis,
    /// Where to.
    pub target: Nanometres,
    /// Length of the trigger pulse, which is the camera's exposure time.
    pub exposure: Micros,
    /// The position counts as settled while it is within this distance of the target...
    pub settle_window: Nanometres,
    /// ...for this long without a break.
    pub settle_dwell: Micros,
    /// Exposures at this position, at least 1.
    pub repeat: u16,
}

/// What was measured at one exposure.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShotRecord {
    /// Place in the program.
    pub index: u8,
    /// Which of the repeats, from 0.
    pub repeat: u16,
    /// Running number of the trigger since the reset; the camera's shot id.
    pub trigger_number: u32,
    /// The axis that was moved.
    pub axis: Axis,
    /// Where it was sent.
    pub asked: Nanometres,
    /// Encoder position of the coarse axis at the trigger.
    pub coarse: Nanometres,
    /// Gauge position of the fine axis at the trigger (mean over the settle dwell).
    pub fine: Nanometres,
    /// From the start of the move until it was settled.
    pub settle: Micros,
    /// Rising edge of the trigger.
    pub trigger: BoardMicros,
    /// Start of the exposure as the camera reports it.
    pub strobe_start: BoardMicros,
    /// End of the exposure as the camera reports it.
    pub strobe_end: BoardMicros,
    /// Length of the trigger pulse.
    pub exposure: Micros,
}

/// Who the board is and what it can do.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Hello {
    /// Oldest protocol version it speaks.
    pub protocol_min: u8,
    /// Newest protocol version it speaks.
    pub protocol_current: u8,
    /// [`SCHEMA_KEY`] of its message table.
    pub schema_key: u64,
    /// Name of the board, e.g. `nucleo-f429zi`.
    pub board: String<24>,
    /// Firmware version.
    pub firmware: String<24>,
    /// The chip's unique id.
    pub unique_id: [u8; 12],
    /// Number of this boot; every other request must carry it.
    pub boot: u32,
    /// Why the board was reset last.
    pub reset_cause: ResetCause,
    /// Whether this is an emulated board.
    pub emulated: bool,
    /// What it can do.
    pub capabilities: Capabilities,
    /// How far and how much.
    pub limits: Limits,
}

/// What a board can do; all `true` for the rig of `docs/rig.md`.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Capabilities {
    /// Has the stepper of stage A.
    pub sensor_coarse: bool,
    /// Has the piezo of stage A.
    pub sensor_fine: bool,
    /// Measures the camera's exposure-active signal.
    pub strobe: bool,
}

/// How far the axes go and how much fits.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Sensor distance from the lens' principal plane at coarse 0 and fine 0.
    pub datum: Nanometres,
    /// Smallest coarse position.
    pub coarse_min: Nanometres,
    /// Largest coarse position.
    pub coarse_max: Nanometres,
    /// Coarse distance per STEP pulse, in picometres.
    pub coarse_step_pm: u32,
    /// Smallest fine position.
    pub fine_min: Nanometres,
    /// Largest fine position.
    pub fine_max: Nanometres,
    /// Shots a program may have.
    pub shots_max: u8,
    /// Shortest exposure.
    pub exposure_min: Micros,
    /// Longest exposure.
    pub exposure_max: Micros,
}

/// Why the board was reset.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ResetCause {
    /// Power came on.
    PowerOn,
    /// The reset pin or button.
    Pin,
    /// [`Request::Reboot`].
    Software,
    /// The independent watchdog: the firmware had stopped responding.
    Watchdog,
    /// The supply dipped.
    BrownOut,
    /// Left a low-power state by reset.
    LowPower,
    /// The flags fit none of these.
    Unknown,
}

/// How the board is.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Status {
    /// The board's time at this answer.
    pub time: BoardMicros,
    /// The coarse axis.
    pub coarse: AxisStatus,
    /// The fine axis; always homed, its gauge is absolute.
    pub fine: AxisStatus,
    /// Whether the home switch is closed.
    pub home_switch: bool,
    /// Whether the far switch is closed.
    pub far_switch: bool,
    /// The request that is under way.
    pub active: Option<u32>,
    /// The number the next event will get.
    pub next_event: u32,
    /// Triggers given since the reset.
    pub triggers: u32,
    /// STEP pulses given since the reset.
    pub steps: u64,
    /// What the link has seen.
    pub link: LinkCounters,
}

/// How an axis is.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct AxisStatus {
    /// What is known of its position.
    pub state: PositionState,
    /// Where it was last sent.
    pub asked: Nanometres,
    /// Where the encoder or gauge says it is.
    pub measured: Nanometres,
    /// Whether it moves.
    pub moving: bool,
}

/// What the board's link has seen since the reset.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LinkCounters {
    /// Good frames.
    pub frames: u32,
    /// Frames dropped for a wrong CRC, length or encoding.
    pub bad_frames: u32,
    /// Repeated requests answered from memory.
    pub repeated: u32,
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
