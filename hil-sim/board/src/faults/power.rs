use super::{Kind, Takes};
use crate::board::SUPPLY_MV;

/// Below the firmware's supply detector (3.03 V), above brown-out level 2.
const LOW_SUPPLY_MV: u32 = 2800;
/// TIM5 is the firmware's time base.
const TIM5_CR1: u64 = 0x4000_0c00;

pub const RESET_BUTTON: Kind =
    Kind { name: "reset-button", takes: Takes::NOTHING, happen: |rig, _| rig.press_reset(), revert: None };
pub const POWER_LOSS: Kind = Kind {
    name: "power-loss",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_power(false),
    revert: Some(|rig, _| rig.set_power(true)),
};
pub const POWER_RETURN: Kind =
    Kind { name: "power-return", takes: Takes::NOTHING, happen: |rig, _| rig.set_power(true), revert: None };
/// After `amount` more bytes written to memory.
pub const POWER_LOSS_IN_A_WRITE: Kind = Kind {
    name: "power-loss-in-a-write",
    takes: Takes::amount(1.0, 100_000.0, 20.0),
    happen: |rig, at| rig.fail_power_after_memory_bytes(at.amount as u64), // the range fits
    revert: Some(|rig, _| {
        rig.keep_power();
        rig.set_power(true);
    }),
};
pub const BROWN_OUT: Kind =
    Kind { name: "brown-out", takes: Takes::NOTHING, happen: |rig, _| rig.brown_out(), revert: None };
pub const SUPPLY_LOW: Kind = Kind {
    name: "supply-low",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_supply_mv(LOW_SUPPLY_MV),
    revert: Some(|rig, _| rig.set_supply_mv(SUPPLY_MV)),
};
pub const SUPPLY_NORMAL: Kind = Kind {
    name: "supply-normal",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_supply_mv(SUPPLY_MV),
    revert: None,
};
/// A stray write stops the firmware's time base.
pub const FIRMWARE_HANGS: Kind = Kind {
    name: "firmware-hangs",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.write_register(TIM5_CR1, 0),
    revert: None,
};
pub const CLOCK_DEAD: Kind = Kind {
    name: "clock-dead",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_outer_clock(false),
    revert: Some(|rig, _| rig.set_outer_clock(true)),
};
