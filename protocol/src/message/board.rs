//! Identity and state of the board.

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{AlarmRecord, Axis, AxisStatus, ProgramStatus};
use crate::units::{BoardMicros, Micros, Nanometres};

/// Identity and capabilities of the board.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Hello {
    /// Oldest supported protocol version.
    pub protocol_min: u8,
    /// Newest supported protocol version.
    pub protocol_current: u8,
    /// [`super::SCHEMA_KEY`] of the firmware.
    pub schema_key: u64,
    /// Board name, e.g. `nucleo-f429zi`.
    pub board: String<24>,
    /// Version of the firmware.
    pub firmware: String<24>,
    /// Unique id of the chip.
    pub unique_id: [u8; 12],
    /// Boot number, required in all other requests.
    pub boot: u32,
    /// Cause of the last reset.
    pub reset_cause: ResetCause,
    /// Whether the board is emulated.
    pub emulated: bool,
    /// Fitted parts of the board.
    pub capabilities: Capabilities,
    /// Ranges and sizes of the board.
    pub limits: Limits,
    /// Largest request id of this boot, 0 = none; a new session continues from it.
    pub last_id: u32,
    /// Limit of outstanding requests.
    pub outstanding: u8,
}

/// Fitted parts; all `true` for the rig of `docs/rig.md`.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct Capabilities {
    /// Stepper of stage A.
    pub sensor_coarse: bool,
    /// Piezo of stage A.
    pub sensor_fine: bool,
    /// Measurement of the camera's exposure signal.
    pub strobe: bool,
    /// Stepper of stage B.
    pub lens: bool,
    /// Non-volatile memory for records.
    pub memory: bool,
    /// Emergency-stop input.
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
    /// Smallest coarse position.
    pub coarse_min: Nanometres,
    /// Largest coarse position.
    pub coarse_max: Nanometres,
    /// Coarse travel per STEP pulse, pm.
    pub coarse_step_pm: u32,
    /// Smallest fine position.
    pub fine_min: Nanometres,
    /// Largest fine position.
    pub fine_max: Nanometres,
    /// Most shots of a program.
    pub shots_max: u8,
    /// Shortest exposure.
    pub exposure_min: Micros,
    /// Longest exposure.
    pub exposure_max: Micros,
    /// Smallest lens position.
    pub lens_min: Nanometres,
    /// Largest lens position.
    pub lens_max: Nanometres,
    /// Lens travel per STEP pulse, pm.
    pub lens_step_pm: u32,
    /// Smallest distance of sensor and lens.
    pub distance_min: Nanometres,
    /// Shortest silence deadline.
    pub silence_min: Micros,
    /// Longest silence deadline.
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

/// Cause of a reset.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ResetCause {
    /// Power was switched on.
    PowerOn,
    /// Reset pin or button.
    Pin,
    /// [`super::Request::Reboot`].
    Software,
    /// Independent watchdog: the firmware had hung.
    Watchdog,
    /// Brown-out of the supply.
    BrownOut,
    /// Reset from a low-power state.
    LowPower,
    /// Unknown combination of flags.
    Unknown,
}

/// State of the board.
#[derive(Serialize, Deserialize, Schema, Clone, PartialEq, Eq, Debug)]
pub struct Status {
    /// Board time of this answer.
    pub time: BoardMicros,
    /// State of the coarse axis.
    pub coarse: AxisStatus,
    /// State of the fine axis; always homed, because its gauge is absolute.
    pub fine: AxisStatus,
    /// State of the lens axis.
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
    /// Whether the supply is too low for an orderly stop.
    pub supply_low: bool,
    /// Latched alarm, if any.
    pub alarm: Option<AlarmRecord>,
    /// State of the exposure program.
    pub program: ProgramStatus,
    /// Number of the next event.
    pub next_event: u32,
    /// Triggers since the reset.
    pub triggers: u32,
    /// STEP pulses of both motors since the reset.
    pub steps: u64,
    /// Statistics of the link.
    pub link: LinkCounters,
}

impl Status {
    /// State of an axis.
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
    /// Valid frames received.
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
