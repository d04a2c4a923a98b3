//! Exposure programs: what is asked of a shot, and what was measured.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;
use crate::units::{BoardMicros, Micros, Nanometres};

/// One entry of an exposure program.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shot {
    /// The axis to move before the exposure.
    pub axis: Axis,
    /// Where to.
    pub target: Nanometres,
    /// The exposure time; with a hardware trigger the length of the pulse.
    pub exposure: Micros,
    /// The position counts as settled while it is within this distance of the target...
    pub settle_window: Nanometres,
    /// ...for this long without a break.
    pub settle_dwell: Micros,
    /// Exposures at this position, at least 1.
    pub repeat: u16,
    /// How the exposure comes about.
    pub mode: TriggerMode,
}

/// What is wrong with a shot.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ShotFault {
    /// The index is not below [`super::Limits::shots_max`], or the program has no shots.
    Index,
    /// This shot of the program was never loaded.
    Missing,
    /// The exposure is outside [`super::Limits::exposure_min`] to [`super::Limits::exposure_max`].
    Exposure,
    /// The settle window or its dwell time is 0 or larger than the board can watch.
    Settle,
    /// The repeat count is 0.
    Repeat,
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
    /// Encoder position of the lens stage at the trigger.
    pub lens: Nanometres,
    /// From the start of the move until it was settled.
    pub settle: Micros,
    /// Rising edge of the trigger; without a trigger, when the shot was ready.
    pub trigger: BoardMicros,
    /// Start of the exposure as the camera reports it.
    pub strobe_start: BoardMicros,
    /// End of the exposure as the camera reports it.
    pub strobe_end: BoardMicros,
    /// Length of the trigger pulse, or what the shot asks for.
    pub exposure: Micros,
}

impl ShotRecord {
    /// Where an axis was at the trigger, by its encoder or gauge.
    pub const fn measured(&self, axis: Axis) -> Nanometres {
        match axis {
            Axis::SensorCoarse => self.coarse,
            Axis::SensorFine => self.fine,
            Axis::Lens => self.lens,
        }
    }
}

/// Why a moment of a continuous run's pace passed without an exposure.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum DropReason {
    /// The position was still on its way, or had not settled.
    NotSettled {
        /// Asked minus measured then.
        error: Nanometres,
    },
    /// The camera still exposed, or read the frame before out.
    CameraBusy,
    /// The camera was triggered, and its exposure-active signal did not come.
    NoStrobe,
}

/// How an exposure comes about.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum TriggerMode {
    /// The board triggers the camera by a pulse as long as the exposure.
    Hardware,
    /// The board says [`super::EventKind::ShotReady`]; the host triggers the camera by its own means, and the camera's
    /// exposure signal ends the shot.
    Software,
    /// The camera runs freely; the first exposure that begins after the position has settled is the shot.
    FreeRunning,
}

/// How the exposure program is.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProgramStatus {
    /// What it does.
    pub state: ProgramState,
    /// Shots that were armed.
    pub shots: u8,
    /// The shot that is under way, or comes next.
    pub index: u8,
    /// Exposures taken in this run; 65,535 where a continuous run has taken more.
    pub exposures: u16,
}

/// What the exposure program does.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ProgramState {
    /// Not armed: shots may be loaded.
    Idle,
    /// Checked; `RunProgram` starts it.
    Armed,
    /// Runs.
    Running,
    /// Stands between two exposures until it is resumed or stopped.
    Paused,
}
