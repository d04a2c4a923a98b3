//! Axes of the rig, and the distance of sensor and lens.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::units::Nanometres;

/// A motor axis; a position is in nanometres.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// Stage A's stepper and screw; 0 at the home switch.
    SensorCoarse,
    /// Stage A's piezo; 0 = relaxed, measured by its strain gauge.
    SensorFine,
    /// Stage B's stepper and screw with the lens; 0 at the home switch, positive away from the sensor.
    Lens,
}

impl Axis {
    /// All axes in wire order.
    pub const ALL: [Self; 3] = [Self::SensorCoarse, Self::SensorFine, Self::Lens];

    /// Name in commands, files and settings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SensorCoarse => "coarse",
            Self::SensorFine => "fine",
            Self::Lens => "lens",
        }
    }

    /// Whether its position adds to the distance of sensor and lens; a filter wheel's would not.
    pub const fn is_in_distance(self) -> bool {
        match self {
            Self::SensorCoarse | Self::SensorFine | Self::Lens => true,
        }
    }
}

/// Distance from the lens' principal plane to the sensor, nm: the datum plus all axes with [`Axis::is_in_distance`].
pub fn sensor_distance_nm(datum: Nanometres, mut position: impl FnMut(Axis) -> Nanometres) -> i64 {
    let parts = Axis::ALL.into_iter().filter(|axis| axis.is_in_distance());
    i64::from(datum.0) + parts.map(|axis| i64::from(position(axis).0)).sum::<i64>()
}

/// Validity of a position.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PositionState {
    /// Not homed since the reset.
    Unknown,
    /// Homed; steps and encoder agree.
    Homed,
    /// Steps and encoder disagree, power was lost in motion, or the gauge is silent: home again.
    Lost,
}

/// Commanded and measured position of an axis.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct AxisStatus {
    pub state: PositionState,
    pub asked: Nanometres,
    /// Position by encoder or gauge.
    pub measured: Nanometres,
    pub moving: bool,
    pub request: Option<u32>,
}
