//! Axes by the names that users type.

use farnear_protocol::message::Axis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum AxisName {
    /// Stage A's stepper and screw.
    Coarse,
    /// Stage A's piezo.
    Fine,
    /// Stage B's stepper and screw, which carry the lens.
    Lens,
}

impl From<AxisName> for Axis {
    fn from(name: AxisName) -> Self {
        match name {
            AxisName::Coarse => Self::SensorCoarse,
            AxisName::Fine => Self::SensorFine,
            AxisName::Lens => Self::Lens,
        }
    }
}
