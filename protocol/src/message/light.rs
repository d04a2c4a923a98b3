//! Light: two outputs for a lamp, a flash or a pattern projector.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// Full brightness, [`LightLevels`].
pub const LIGHT_LEVEL_MAX: u16 = 1_000;
/// Longest time for which the outputs stay on without another [`super::Request::SetLights`].
pub const LIGHT_TIME_MAX: Micros = Micros(60_000_000);

/// Brightness of both outputs in thousandths: the duty cycle of a 21 kHz PWM. 0 is off, 1000 on without a gap.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LightLevels {
    pub first: u16,
    pub second: u16,
}

impl LightLevels {
    /// Both outputs at brightness 0.
    pub const OFF: Self = Self { first: 0, second: 0 };

    /// Brightness of both outputs in percent.
    pub fn percent(self) -> [f64; 2] {
        [self.first, self.second].map(|level| 100.0 * f64::from(level) / f64::from(LIGHT_LEVEL_MAX))
    }

    /// Whether either output is on.
    pub const fn is_on(self) -> bool {
        self.first > 0 || self.second > 0
    }

    /// Whether both levels are within [`LIGHT_LEVEL_MAX`].
    pub const fn is_valid(self) -> bool {
        self.first <= LIGHT_LEVEL_MAX && self.second <= LIGHT_LEVEL_MAX
    }
}

/// A flash within an exposure.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShotLight {
    /// Brightness during the flash; otherwise that of [`super::Request::SetLights`].
    pub levels: LightLevels,
    /// From the rising edge of the trigger to the start of the flash.
    pub delay: Micros,
    /// Length of the flash; it ends no later than the trigger pulse.
    pub length: Micros,
}

/// Why the board does not set the light.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LightFault {
    /// A brightness exceeds [`LIGHT_LEVEL_MAX`].
    Level,
    /// The time is 0 or exceeds [`LIGHT_TIME_MAX`], or a flash has no length.
    Time,
    /// The flash does not end within the exposure.
    Exposure,
    /// Only a shot of [`super::TriggerMode::Hardware`] can have a flash.
    Mode,
}
