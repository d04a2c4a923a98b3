//! The movable parts of the rig.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::units::Nanometres;

/// A movable part of the rig.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// Stage A's stepper and screw, 0 at the home switch.
    SensorCoarse,
    /// Stage A's piezo, 0 = relaxed, as its strain gauge measures it.
    SensorFine,
    /// Stage B's stepper and screw, which carry the lens: 0 at the home switch, positive away from the sensor.
    Lens,
}

impl Axis {
    /// All, in the order of their numbers on the wire.
    pub const ALL: [Self; 3] = [Self::SensorCoarse, Self::SensorFine, Self::Lens];

    /// Its name in commands, in files and among the settings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SensorCoarse => "coarse",
            Self::SensorFine => "fine",
            Self::Lens => "lens",
        }
    }

    /// Whether its position is part of the distance between sensor and lens. Not every movable part is: a filter wheel
    /// would turn and leave the distance as it is.
    pub const fn is_in_distance(self) -> bool {
        match self {
            Self::SensorCoarse | Self::SensorFine | Self::Lens => true,
        }
    }
}

/// Sensor distance from the lens' principal plane, nanometres: the datum and the positions of those axes that are part
/// of it ([`Axis::is_in_distance`]). The one sum of this kind: whoever adds an axis says there whether it joins.
pub fn sensor_distance_nm(datum: Nanometres, mut position: impl FnMut(Axis) -> Nanometres) -> i64 {
    let parts = Axis::ALL.into_iter().filter(|axis| axis.is_in_distance());
    i64::from(datum.0) + parts.map(|axis| i64::from(position(axis).0)).sum::<i64>()
}

/// What is known of an axis' position.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PositionState {
    /// Never homed since the reset, and at rest before it.
    Unknown,
    /// Homed, and steps and encoder have agreed since.
    Homed,
    /// Was homed, but steps and encoder disagree, or it moved when the power went: home again. The piezo's as long as its
    /// gauge is silent.
    Lost,
}

/// How an axis is.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct AxisStatus {
    /// What is known of its position.
    pub state: PositionState,
    /// Where it was last sent.
    pub asked: Nanometres,
    /// Where the encoder or gauge says it is.
    pub measured: Nanometres,
    /// Whether it moves.
    pub moving: bool,
    /// The request that is under way on it.
    pub request: Option<u32>,
}
