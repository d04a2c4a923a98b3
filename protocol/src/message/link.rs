//! How fast the link is.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// A new rate is on trial for so long: where no good request comes in at it, the board goes back to the one before. Longer than a
/// host takes that asks four times, 50 ms each.
pub const LINK_TRIAL: Micros = Micros(300_000);

/// A rate of the link, 8 data bits, no parity, 1 stop bit. Each reset begins with [`LinkRate::START`].
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LinkRate {
    /// 2,000,000 baud.
    Baud2000000,
    /// 921,600 baud, for adapters and cables that lose bytes at the other.
    Baud921600,
}

impl LinkRate {
    /// All, in the order of their numbers on the wire.
    pub const ALL: [Self; 2] = [Self::Baud2000000, Self::Baud921600];
    /// After each reset.
    pub const START: Self = Self::Baud2000000;

    /// Symbols per second.
    pub const fn baud(self) -> u32 {
        match self {
            Self::Baud2000000 => 2_000_000,
            Self::Baud921600 => 921_600,
        }
    }

    /// The rate of this many symbols per second.
    pub fn of(baud: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|rate| rate.baud() == baud)
    }
}
