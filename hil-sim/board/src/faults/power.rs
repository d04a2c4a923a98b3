//! Supply, clock, resets, and a program that has lost its way.

use super::{Kind, Takes};
use crate::board::SUPPLY_MV;

/// A supply at which the chip still runs but its detector speaks up (the firmware sets it to 3.03 V) and above the brown-out reset of level 2.
const LOW_SUPPLY_MV: u32 = 2800;
/// TIM5, which keeps the firmware's time.
const TIM5_CR1: u64 = 0x4000_0c00;

/// Somebody presses the reset button.
pub const RESET_BUTTON: Kind =
    Kind { name: "reset-button", takes: Takes::NOTHING, happen: |rig, _| rig.press_reset(), mend: None };
/// The power goes; the volatile memory forgets.
pub const POWER_LOSS: Kind = Kind {
    name: "power-loss",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_power(false),
    mend: Some(|rig, _| rig.set_power(true)),
};
/// The power comes back.
pub const POWER_RETURN: Kind =
    Kind { name: "power-return", takes: Takes::NOTHING, happen: |rig, _| rig.set_power(true), mend: None };
/// The power goes when the firmware has written so many more bytes to its memory.
pub const POWER_LOSS_IN_A_WRITE: Kind = Kind {
    name: "power-loss-in-a-write",
    takes: Takes::amount(1.0, 100_000.0, 20.0),
    happen: |rig, at| rig.fail_power_after_memory_bytes(at.amount as u64), // the range fits
    mend: Some(|rig, _| {
        rig.keep_power();
        rig.set_power(true);
    }),
};
/// The supply dips for so short a time that only the brown-out reset notices.
pub const BROWN_OUT: Kind =
    Kind { name: "brown-out", takes: Takes::NOTHING, happen: |rig, _| rig.brown_out(), mend: None };
/// The supply sinks to 2.8 V.
pub const SUPPLY_LOW: Kind = Kind {
    name: "supply-low",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_supply_mv(LOW_SUPPLY_MV),
    mend: Some(|rig, _| rig.set_supply_mv(SUPPLY_MV)),
};
/// The supply is as it should be.
pub const SUPPLY_NORMAL: Kind = Kind {
    name: "supply-normal",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_supply_mv(SUPPLY_MV),
    mend: None,
};
/// A stray write stops the timer that keeps the firmware's time.
pub const FIRMWARE_HANGS: Kind = Kind {
    name: "firmware-hangs",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.write_register(TIM5_CR1, 0),
    mend: None,
};
/// The ST-LINK, which clocks the chip, stops.
pub const CLOCK_DEAD: Kind = Kind {
    name: "clock-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_outer_clock(false),
    mend: Some(|rig, _| rig.set_outer_clock(true)),
};
