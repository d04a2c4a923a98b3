//! What the page is told and tells: the types of the interface, with their JSON schemas.

use farnear_depth::focus_measure::FocusMeasure;
use farnear_protocol::message::Axis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Everything that changes, as it is now.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct State {
    /// The rig.
    pub rig: RigState,
    /// The job on the rig: the one under way, or the last.
    pub job: Option<Job>,
    /// The computation under way, or the last.
    pub computation: Option<Job>,
    /// Live image or depth.
    pub live: LiveState,
    /// Which browser has control.
    pub control: ControlState,
    /// A question of a job to the browser that has control.
    pub question: Option<String>,
    /// Grows with every change of captures, notes or maps.
    pub captures: u64,
    /// Grows with every change of the optics.
    pub optics: u64,
    /// Lines of the log so far.
    pub log: u64,
}

/// The rig.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct RigState {
    /// How the connection is.
    pub phase: Phase,
    /// Port, or "the emulated rig".
    pub name: Option<String>,
    /// Whether it is emulated: no hardware is involved.
    pub emulated: bool,
    /// Why it cannot be talked to.
    pub error: Option<String>,
    /// Positions, limits, alarms: as `farnear rig info --json` prints them, less the count of the line's frames.
    pub info: Option<Value>,
}

/// How the connection to the rig is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// None was asked for.
    Absent,
    /// It is being connected to.
    Connecting,
    /// It answers.
    Ready,
    /// It does not answer.
    Lost,
}

/// A job.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct Job {
    /// Its number.
    pub id: u64,
    /// What kind: `home`, `move`, `pair`, `depth`, ...
    pub kind: String,
    /// In words.
    pub title: String,
    /// How it stands.
    pub phase: JobPhase,
    /// What it said last.
    pub said: Option<String>,
    /// What it warned of.
    pub warnings: Vec<String>,
    /// How far it is: unit, done, total.
    pub progress: Option<JobProgress>,
    /// Its figures, as the command of the same name prints them with `--json`.
    pub result: Option<Value>,
    /// Why it came to nothing.
    pub error: Option<String>,
    /// What to do about that.
    pub hint: Option<String>,
}

/// How a job stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum JobPhase {
    /// Under way.
    Running,
    /// Came to its end.
    Done,
    /// Came to nothing.
    Failed,
    /// Somebody stopped it.
    Stopped,
}

/// How far a job is.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct JobProgress {
    /// What is counted.
    pub unit: String,
    /// So many are done.
    pub done: usize,
    /// Of so many.
    pub total: Option<usize>,
}

/// Live image or depth.
#[derive(Clone, PartialEq, Debug, Serialize, JsonSchema)]
pub struct LiveState {
    /// What is wanted.
    pub mode: LiveMode,
    /// Length of an exposure.
    pub exposure_us: u32,
    /// What the focus is measured by.
    #[schemars(with = "String")]
    pub measure: FocusMeasure,
    /// Why there is none though it is wanted.
    pub error: Option<String>,
    /// Name of the recording that live depth goes into.
    pub recording: Option<String>,
    /// Why the last recording ended by itself: the disk is full, or it has as many pairs as one may have.
    pub recording_ended: Option<String>,
    /// Whether there is a camera though no rig: its image can be seen live, nothing else.
    pub camera_alone: bool,
}

/// What is looked at live.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LiveMode {
    /// Nothing.
    Off,
    /// The image where the sensor stands.
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
    /// This program.
    pub version: String,
}

/// An axis by its name.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AxisName {
    /// Stage A's stepper.
    Coarse,
    /// Stage A's piezo.
    Fine,
    /// The lens stage.
    Lens,
}

impl From<AxisName> for Axis {
    fn from(name: AxisName) -> Self {
        match name {
            AxisName::Coarse => Self::SensorCoarse,
            AxisName::Fine => Self::SensorFine,
            AxisName::Lens => Self::Lens,
        }
    }
}

/// That a job was begun.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct Begun {
    /// Its number: its end is told by the state.
    pub job: u64,
}

/// That something was done.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct Done {
    /// Always true.
    pub done: bool,
}

/// The one value of [`Done`].
pub const DONE: Done = Done { done: true };

/// A request that says nothing: `{}`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}
