//! Newtypes that carry the units on the wire.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A position or distance along an axis in nanometres, positive = sensor AWAY from the lens.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Nanometres(pub i32);

/// A moment: microseconds of the board's clock since its reset. Meaningful only together with the boot number.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BoardMicros(pub u64);

/// A duration in microseconds (at most 71 minutes).
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Micros(pub u32);
