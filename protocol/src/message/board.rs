//! Who the board is and how it is.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{AlarmRecord, Axis, AxisStatus, ProgramStatus};
use crate::units::{BoardMicros, Micros, Nanometres};

/// Who the board is and what it can do.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Hello {
    /// Oldest protocol version it speaks.
    pub protocol_min: u8,
    /// Newest protocol version it speaks.
    pub protocol_current: u8,
    /// [`super::SCHEMA_KEY`] of its message table.
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
    /// The largest request id of this boot, 0 where there was none; ids of a new session go on from it.
    pub last_id: u32,
    /// How many requests may wait for their answers at a time.
    pub outstanding: u8,
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
    /// Has the stepper of stage B.
    pub lens: bool,
    /// Has memory that keeps records without power.
    pub memory: bool,
    /// Has an emergency-stop input.
    pub emergency_stop: bool,
}

impl Capabilities {
    /// Whether the board has an axis.
    pub const fn has(&self, axis: Axis) -> bool {
        match axis {
            Axis::SensorCoarse => self.sensor_coarse,
            Axis::SensorFine => self.sensor_fine,
            Axis::Lens => self.lens,
        }
    }
}

/// How far the axes go and how much fits.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Sensor distance from the lens' principal plane with all axes at 0.
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
    /// Smallest position of the lens stage.
    pub lens_min: Nanometres,
    /// Largest position of the lens stage.
    pub lens_max: Nanometres,
    /// Distance of the lens stage per STEP pulse, in picometres.
    pub lens_step_pm: u32,
    /// Smallest distance between sensor and lens.
    pub distance_min: Nanometres,
    /// Shortest deadline for the host's silence.
    pub silence_min: Micros,
    /// Longest deadline for the host's silence.
    pub silence_max: Micros,
    /// Pixels of the row buffer for depth correction.
    pub row_pixels_max: u16,
}

impl Limits {
    /// Smallest and largest position of an axis.
    pub const fn of(&self, axis: Axis) -> (Nanometres, Nanometres) {
        match axis {
            Axis::SensorCoarse => (self.coarse_min, self.coarse_max),
            Axis::SensorFine => (self.fine_min, self.fine_max),
            Axis::Lens => (self.lens_min, self.lens_max),
        }
    }
}

/// Why the board was reset.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ResetCause {
    /// Power came on.
    PowerOn,
    /// The reset pin or button.
    Pin,
    /// [`super::Request::Reboot`].
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
    /// The lens axis.
    pub lens: AxisStatus,
    /// Whether stage A's home switch is closed.
    pub home_switch: bool,
    /// Whether stage A's far switch is closed.
    pub far_switch: bool,
    /// Whether stage B's home switch is closed.
    pub lens_home_switch: bool,
    /// Whether stage B's far switch is closed.
    pub lens_far_switch: bool,
    /// Whether the emergency-stop input is open.
    pub emergency_stop: bool,
    /// Whether the supply is below the level at which the board can stop in order.
    pub supply_low: bool,
    /// The latched alarm.
    pub alarm: Option<AlarmRecord>,
    /// The exposure program.
    pub program: ProgramStatus,
    /// The number the next event will get.
    pub next_event: u32,
    /// Triggers given since the reset.
    pub triggers: u32,
    /// STEP pulses given to both motors since the reset.
    pub steps: u64,
    /// What the link has seen.
    pub link: LinkCounters,
}

impl Status {
    /// How an axis is.
    pub const fn axis(&self, axis: Axis) -> &AxisStatus {
        match axis {
            Axis::SensorCoarse => &self.coarse,
            Axis::SensorFine => &self.fine,
            Axis::Lens => &self.lens,
        }
    }

    /// Whether an axis' home switch and its far switch are closed; an axis without switches has both open.
    pub const fn switches(&self, axis: Axis) -> [bool; 2] {
        match axis {
            Axis::SensorCoarse => [self.home_switch, self.far_switch],
            Axis::SensorFine => [false; 2],
            Axis::Lens => [self.lens_home_switch, self.lens_far_switch],
        }
    }
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
    /// Requests refused because they belong to no open session, or are older than what is remembered.
    pub stale: u32,
    /// Requests that found no room: [`super::RequestError::QueueFull`], also where there was no room for that answer.
    pub overflowed: u32,
}
