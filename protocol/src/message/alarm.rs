//! Alarms: what stopped the rig. An alarm is latched, survives the reset (in the board's memory), refuses all motion,
//! and goes only when the host clears it by its number: nobody can clear what was not read.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{Axis, RecordName};
use crate::units::{BoardMicros, Nanometres};

/// An alarm that came up.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AlarmRecord {
    /// Running number of alarms in this board's life, from 1.
    pub number: u32,
    /// The boot in which it came up.
    pub boot: u32,
    /// When, in the time of that boot.
    pub time: BoardMicros,
    /// What.
    pub alarm: Alarm,
}

/// What stopped the rig.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Alarm {
    /// The emergency-stop input is open. Clearing is refused while it is.
    EmergencyStop,
    /// The host asked for [`super::Request::Halt`].
    Halt,
    /// A motor driver reports a fault on its DIAG line.
    DriverFault {
        /// The axis.
        axis: Axis,
    },
    /// The encoder is this far from the commanded position: stall or slip.
    Following {
        /// The axis.
        axis: Axis,
        /// Commanded minus measured.
        error: Nanometres,
    },
    /// A step timer could not be fed in time: a step came late or not at all.
    StepUnderrun {
        /// The axis.
        axis: Axis,
    },
    /// An end switch closed where none should be.
    UnexpectedSwitch {
        /// The axis.
        axis: Axis,
        /// Whether it was the far one, and not the home switch.
        far: bool,
    },
    /// The strain gauge answers nonsense, or the piezo does not follow.
    Gauge,
    /// The host said nothing for as long as the request had allowed, while something moved.
    HostSilence {
        /// The request that was under way.
        request: u32,
    },
    /// The supply fell below the level at which the board can still stop in order.
    SupplyLow,
    /// The last reset was a brown-out.
    BrownOut,
    /// The last reset came from the watchdog: the firmware had stopped responding.
    Watchdog,
    /// The firmware stopped itself at an inner contradiction.
    Panic,
    /// The stack grew into its guard.
    StackOverflow,
    /// More came from the link than the board could take.
    QueueOverflow,
    /// The power went, or the board was reset, while this axis moved: its position is lost.
    MotionInterrupted {
        /// The axis.
        axis: Axis,
    },
    /// Both copies of a record in the board's memory are bad; its defaults are in use.
    RecordLost {
        /// Which.
        record: RecordName,
    },
    /// The board's memory does not answer: nothing outlasts a loss of power.
    MemoryMissing,
    /// The clock that the board is fed did not come, or stopped, which resets the board. As long as it is missing the board runs on
    /// the chip's own, by which times and speeds are a few per cent off.
    ClockLost,
}
