//! Rates of the serial link.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// Trial time of a new rate; without a valid request the old one returns. Exceeds a host's four attempts of 50 ms.
pub const LINK_TRIAL: Micros = Micros(300_000);

/// A link rate, 8N1. Each reset starts with [`LinkRate::START`].
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LinkRate {
    /// 2,000,000 baud, the rate after a reset.
    Baud2000000,
    /// 921,600 baud, for adapters and cables that lose bytes at 2,000,000.
    Baud921600,
}

impl LinkRate {
    /// All rates in wire order.
    pub const ALL: [Self; 2] = [Self::Baud2000000, Self::Baud921600];
    /// Rate after each reset.
    pub const START: Self = Self::Baud2000000;

    /// The rate in bits per second.
    pub const fn baud(self) -> u32 {
        match self {
            Self::Baud2000000 => 2_000_000,
            Self::Baud921600 => 921_600,
        }
    }

    /// The rate with this baud number.
    pub fn of(baud: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|rate| rate.baud() == baud)
    }
}
