//! The movable parts of the rig.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::units::Nanometres;

/// A movable part of the rig.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Axis {
    /// Stage A's stepper and screw, 0 at the home switch.
    SensorCoarse,
    /// Stage A's piezo, 0 = relaxed, as its strain gauge measures it.
    SensorFine,
    /// Stage B's stepper and screw, which carry the lens: 0 at the home switch, positive away from the sensor.
    Lens,
}

/// What is known of an axis' position.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum PositionState {
    /// Never homed since the reset, and at rest before it.
    Unknown,
    /// Homed, and steps and encoder have agreed since.
    Homed,
    /// Was homed, but steps and encoder disagree, or it moved when the power went: home again.
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
