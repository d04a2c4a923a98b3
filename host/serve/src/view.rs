//! Messages of the API, with their JSON schemas.

use farnear_depth::focus_measure::FocusMeasure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The present state of everything that changes.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct State {
    /// State of the rig; absent without one.
    pub rig: RigState,
    /// The running or the last job of the rig.
    pub job: Option<Job>,
    /// The running or the last computation.
    pub computation: Option<Job>,
    /// Live image or depth.
    pub live: LiveState,
    /// Which browser has control.
    pub control: ControlState,
    /// Prompt of a job for the browser that has control.
    pub question: Option<String>,
    /// Number of prompts so far: two with equal words have different numbers.
    pub questions: u64,
    /// Grows with every change of captures, notes or maps.
    pub captures: u64,
    /// Grows with every change of the optics.
    pub optics: u64,
    /// Lines of the log so far.
    pub log: u64,
}

/// A line of the log.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct LogLine {
    /// Milliseconds since 1970 by the clock of the rig's computer.
    pub unix_ms: f64,
    pub text: String,
}

/// The rig.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct RigState {
    /// State of the connection.
    pub phase: Phase,
    /// Port, or "the emulated rig".
    pub name: Option<String>,
    /// Whether it is emulated: no hardware is involved.
    pub emulated: bool,
    /// Scene of the emulated rig.
    pub scene: Option<String>,
    /// Why it cannot be talked to.
    pub error: Option<String>,
    /// Positions, limits, alarms: as `farnear rig info --json` prints them, less the count of the line's frames.
    pub info: Option<Value>,
}

/// How the connection to the rig is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// No connection was requested.
    Absent,
    /// It is being connected to.
    Connecting,
    /// Whether the board answers.
    Ready,
    /// It does not answer.
    Lost,
}

/// A job of the rig.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct Job {
    /// Number of the job, increasing.
    pub id: u64,
    /// Kind of job: `home`, `move`, `pair`, `depth`, ...
    pub kind: String,
    /// Name of the job in words.
    pub title: String,
    /// State of the job.
    pub phase: JobPhase,
    /// Latest message.
    pub said: Option<String>,
    /// Warnings so far.
    pub warnings: Vec<String>,
    /// Progress: unit, done, total.
    pub progress: Option<JobProgress>,
    /// Figures, as the command of the same name prints them with `--json`.
    pub result: Option<Value>,
    /// Error message of a failed job.
    pub error: Option<String>,
    /// Remedy for the error.
    pub hint: Option<String>,
}

/// State of a job.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum JobPhase {
    /// The job is running.
    Running,
    /// The job has finished.
    Done,
    /// The job has failed.
    Failed,
    /// A user has stopped the job.
    Stopped,
}

/// Progress of a job.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct JobProgress {
    /// Unit of the count.
    pub unit: String,
    /// Number of finished units.
    pub done: usize,
    /// Total of the count, if known.
    pub total: Option<usize>,
}

/// Live image or depth.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct LiveState {
    /// Selected live mode.
    pub mode: LiveMode,
    /// Exposure time, us.
    pub exposure_us: u32,
    /// Brightness of the board's light outputs during captures and live depth.
    pub light_percent: [f64; 2],
    /// Focus measure.
    #[schemars(with = "String")]
    pub measure: FocusMeasure,
    /// Part of the live image that its figures describe: column, row, width, height in pixels; absent: all.
    pub region: Option<[usize; 4]>,
    /// Why the selected mode gives no image.
    pub error: Option<String>,
    /// Name of the running recording of live depth.
    pub recording: Option<String>,
    /// Why the last recording ended automatically: the disk is full, or the largest number of pairs is reached.
    pub recording_ended: Option<String>,
    /// Whether a camera is connected without a rig: only its live image is available.
    pub camera_alone: bool,
}

/// Live mode.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LiveMode {
    /// No live image.
    Off,
    /// Image at the present sensor position.
    Image,
    /// Depth, pair after pair.
    Depth,
}

/// Which browser has control.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct ControlState {
    /// Number of the client that has control.
    pub holder: Option<u32>,
    /// Number of the client that requests control.
    pub requested_by: Option<u32>,
    /// Number of connected browsers.
    pub clients: usize,
}

/// The first message on a socket.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct Hello {
    /// The client's number.
    pub client: u32,
    /// Its secret, for the header `x-farnear-client`.
    pub secret: String,
    /// Version and start of this server. A page of another one must be reloaded: its job numbers mean other jobs.
    pub server: String,
}

/// That a job was begun.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct Begun {
    /// Number of the job; its end appears in the state.
    pub job: u64,
}

/// The request was carried out.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct Done {
    /// Always true.
    pub done: bool,
}

pub const DONE: Done = Done { done: true };

/// A request that says nothing: `{}`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}
