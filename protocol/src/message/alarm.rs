//! Alarms stop the rig. An alarm is latched in memory, survives resets and blocks all motion until the host clears it
//! by number, so that only a reported alarm can be cleared.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{Axis, RecordName};
use crate::units::{BoardMicros, Nanometres};

/// An alarm with its number and time.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AlarmRecord {
    /// Number in this board's life, from 1.
    pub number: u32,
    pub boot: u32,
    /// Time since the start of that boot.
    pub time: BoardMicros,
    pub alarm: Alarm,
}

/// What raised an alarm, with the offending axis or value.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Alarm {
    /// Emergency-stop input open; cannot be cleared until it closes.
    EmergencyStop,
    /// [`super::Request::Halt`] of the host.
    Halt,
    /// Fault on a motor driver's DIAG line.
    DriverFault { axis: Axis },
    /// Encoder off the commanded position: stall or slip.
    Following {
        axis: Axis,
        /// Commanded minus measured.
        error: Nanometres,
    },
    /// A step timer underran: a step was late or missing.
    StepUnderrun { axis: Axis },
    /// An end switch closed unexpectedly.
    UnexpectedSwitch {
        axis: Axis,
        /// Far switch rather than home switch.
        far: bool,
    },
    /// Invalid strain gauge data, or the piezo does not follow.
    Gauge,
    /// No request within the permitted silence during motion.
    HostSilence { request: u32 },
    /// Supply below the level for an orderly stop.
    SupplyLow,
    /// The last reset was a brown-out.
    BrownOut,
    /// Last reset by the watchdog: the firmware had hung.
    Watchdog,
    /// Internal error of the firmware.
    Panic,
    /// The stack reached its guard.
    StackOverflow,
    /// Input overflow on the link.
    QueueOverflow,
    /// Power loss or reset while this axis moved: position lost.
    MotionInterrupted { axis: Axis },
    /// Both copies of a record are damaged; defaults are in use.
    RecordLost { record: RecordName },
    /// No answer from the memory: nothing survives a power loss.
    MemoryMissing,
    /// The external clock is missing or has stopped (which resets the board). Times are a few per cent off.
    ClockLost,
}
