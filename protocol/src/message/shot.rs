//! Exposure programs: shots and their records.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;
use crate::units::{BoardMicros, Micros, Nanometres};

/// An entry of an exposure program.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shot {
    /// Axis to move before the exposure.
    pub axis: Axis,
    pub target: Nanometres,
    /// Exposure time; with a hardware trigger the pulse length.
    pub exposure: Micros,
    /// Settled while within this distance of the target...
    pub settle_window: Nanometres,
    /// ...for this long without interruption.
    pub settle_dwell: Micros,
    /// Exposures at this position, at least 1.
    pub repeat: u16,
    pub mode: TriggerMode,
}

/// Why a shot was rejected.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ShotFault {
    /// Index not below [`super::Limits::shots_max`], or an empty program.
    Index,
    Missing,
    /// Exposure outside [`super::Limits::exposure_min`] to [`super::Limits::exposure_max`].
    Exposure,
    /// Settle window or dwell is 0 or too large.
    Settle,
    Repeat,
}

/// Measurements of one exposure.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShotRecord {
    pub index: u8,
    /// Repeat of the shot, from 0.
    pub repeat: u16,
    /// Trigger number since the reset; the camera's shot id.
    pub trigger_number: u32,
    pub axis: Axis,
    pub asked: Nanometres,
    /// Coarse position by encoder at the trigger.
    pub coarse: Nanometres,
    /// Fine position by gauge, mean over the settle dwell.
    pub fine: Nanometres,
    /// Lens position by encoder at the trigger.
    pub lens: Nanometres,
    /// Time from the start of the move until settled.
    pub settle: Micros,
    /// Rising trigger edge; without a trigger, the time when the shot was ready.
    pub trigger: BoardMicros,
    /// Start of the exposure by the camera's signal.
    pub strobe_start: BoardMicros,
    /// End of the exposure by the camera's signal.
    pub strobe_end: BoardMicros,
    /// Trigger pulse length, or the requested exposure.
    pub exposure: Micros,
}

/// How much shorter than the exposure the camera's signal may be: cameras count in lines of some 10 us, and two crystals
/// differ by 50 ppm each, plus a margin.
pub const fn strobe_tolerance(exposure: Micros) -> Micros {
    Micros(100 + exposure.0 / 5_000)
}

impl ShotRecord {
    /// Position of an axis at the trigger, by encoder or gauge.
    pub const fn measured(&self, axis: Axis) -> Nanometres {
        match axis {
            Axis::SensorCoarse => self.coarse,
            Axis::SensorFine => self.fine,
            Axis::Lens => self.lens,
        }
    }
}

/// Why a period of a continuous run had no exposure.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum DropReason {
    /// Position still moving or not settled.
    NotSettled {
        /// Target minus measured position.
        error: Nanometres,
    },
    /// Camera still exposing or reading out.
    CameraBusy,
    /// Triggered, but without exposure signal.
    NoStrobe,
}

/// Source of the trigger.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum TriggerMode {
    /// The board sends a pulse as long as the exposure.
    Hardware,
    /// The host triggers the camera after [`super::EventKind::ShotReady`]; the camera's exposure signal ends the shot.
    Software,
    /// Free-running camera; the shot is the first exposure that begins after settling.
    FreeRunning,
}

/// State of the exposure program.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProgramStatus {
    pub state: ProgramState,
    pub shots: u8,
    /// Current or next shot.
    pub index: u8,
    /// Exposures of this run, saturating at 65,535.
    pub exposures: u16,
}

/// Phase of the exposure program.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ProgramState {
    /// Not armed: shots may be loaded.
    Idle,
    /// Checked; `RunProgram` starts it.
    Armed,
    Running,
    Paused,
}
