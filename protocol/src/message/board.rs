//! Identity and state of the board.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{AlarmRecord, Axis, AxisStatus, ProgramStatus};
use crate::units::{BoardMicros, Micros, Nanometres};

/// Identity and capabilities of the board.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Hello {
    pub protocol_min: u8,
    pub protocol_current: u8,
    /// [`super::SCHEMA_KEY`] of the firmware.
    pub schema_key: u64,
    /// Board name, e.g. `nucleo-f429zi`.
    pub board: String<24>,
    pub firmware: String<24>,
    pub unique_id: [u8; 12],
    /// Boot number, required in all other requests.
    pub boot: u32,
    pub reset_cause: ResetCause,
    pub emulated: bool,
    pub capabilities: Capabilities,
    pub limits: Limits,
    /// Largest request id of this boot, 0 = none; a new session continues from it.
    pub last_id: u32,
    pub outstanding: u8,
}

/// Fitted parts; all `true` for the rig of `docs/rig.md`.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Capabilities {
    /// Stage A's stepper and screw.
    pub sensor_coarse: bool,
    /// Stage A's piezo and gauge.
    pub sensor_fine: bool,
    /// Measurement of the camera's exposure signal.
    pub strobe: bool,
    /// Stage B's stepper and screw.
    pub lens: bool,
    pub memory: bool,
    pub emergency_stop: bool,
}

impl Capabilities {
    /// Whether this axis exists.
    pub const fn has(&self, axis: Axis) -> bool {
        match axis {
            Axis::SensorCoarse => self.sensor_coarse,
            Axis::SensorFine => self.sensor_fine,
            Axis::Lens => self.lens,
        }
    }
}

/// Ranges and sizes of the board.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Distance of principal plane and sensor with all axes at 0.
    pub datum: Nanometres,
    pub coarse_min: Nanometres,
    pub coarse_max: Nanometres,
    pub coarse_step_pm: u32,
    pub fine_min: Nanometres,
    pub fine_max: Nanometres,
    pub shots_max: u8,
    pub exposure_min: Micros,
    pub exposure_max: Micros,
    pub lens_min: Nanometres,
    pub lens_max: Nanometres,
    pub lens_step_pm: u32,
    /// Smallest distance of sensor and lens.
    pub distance_min: Nanometres,
    pub silence_min: Micros,
    pub silence_max: Micros,
    /// Size of the row buffer for depth correction.
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

/// Why the processor was reset, from its flags.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ResetCause {
    PowerOn,
    Pin,
    /// [`super::Request::Reboot`].
    Software,
    /// Independent watchdog: the firmware had hung.
    Watchdog,
    BrownOut,
    LowPower,
    /// Unknown combination of flags.
    Unknown,
}

/// Positions, switches, alarm, program and counters of the board.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Status {
    pub time: BoardMicros,
    pub coarse: AxisStatus,
    /// State of the fine axis; always homed, because its gauge is absolute.
    pub fine: AxisStatus,
    pub lens: AxisStatus,
    pub home_switch: bool,
    pub far_switch: bool,
    pub lens_home_switch: bool,
    pub lens_far_switch: bool,
    /// Whether the emergency-stop input is open.
    pub emergency_stop: bool,
    /// Whether the supply is too low for an orderly stop.
    pub supply_low: bool,
    pub alarm: Option<AlarmRecord>,
    pub program: ProgramStatus,
    pub next_event: u32,
    pub triggers: u32,
    /// STEP pulses of both motors since the reset.
    pub steps: u64,
    pub link: LinkCounters,
}

impl Status {
    /// Commanded and measured position of an axis.
    pub const fn axis(&self, axis: Axis) -> &AxisStatus {
        match axis {
            Axis::SensorCoarse => &self.coarse,
            Axis::SensorFine => &self.fine,
            Axis::Lens => &self.lens,
        }
    }

    /// Whether home and far switch of an axis are closed; both open for an axis without switches.
    pub const fn switches(&self, axis: Axis) -> [bool; 2] {
        match axis {
            Axis::SensorCoarse => [self.home_switch, self.far_switch],
            Axis::SensorFine => [false; 2],
            Axis::Lens => [self.lens_home_switch, self.lens_far_switch],
        }
    }
}

/// Link statistics since the reset.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LinkCounters {
    pub frames: u32,
    /// Frames with a wrong CRC, length or encoding.
    pub bad_frames: u32,
    /// Repeated requests, answered from memory.
    pub repeated: u32,
    /// Requests rejected for a wrong session or an old id.
    pub stale: u32,
    /// Requests without room, with or without [`super::RequestError::QueueFull`].
    pub overflowed: u32,
}
