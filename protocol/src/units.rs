//! Newtypes with the units on the wire.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Position or distance along an axis, positive = sensor AWAY from the lens.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Nanometres(pub i32);

/// Microseconds of the board's clock since its reset; valid only together with the boot number.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BoardMicros(pub u64);

/// Duration in microseconds (at most 71 minutes).
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Micros(pub u32);
