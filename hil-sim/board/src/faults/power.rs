//! Supply, resets, and a program that has lost its way.

use super::Kind;
use crate::board::SUPPLY_MV;

/// A supply at which the chip still runs but its detector speaks up (the firmware sets it to 2.93 V).
const LOW_SUPPLY_MV: u32 = 2800;
/// TIM5, which keeps the firmware's time.
const TIM5_CR1: u64 = 0x4000_0c00;

/// Somebody presses the reset button.
pub const RESET_BUTTON: Kind = Kind { name: "reset-button", happen: |rig, _| rig.press_reset() };
/// The power goes; the volatile memory forgets.
pub const POWER_LOSS: Kind = Kind { name: "power-loss", happen: |rig, _| rig.set_power(false) };
/// The power comes back.
pub const POWER_RETURN: Kind = Kind { name: "power-return", happen: |rig, _| rig.set_power(true) };
/// The supply dips for so short a time that only the brown-out reset notices.
pub const BROWN_OUT: Kind = Kind { name: "brown-out", happen: |rig, _| rig.brown_out() };
/// The supply sinks to 2.8 V.
pub const SUPPLY_LOW: Kind = Kind { name: "supply-low", happen: |rig, _| rig.set_supply_mv(LOW_SUPPLY_MV) };
/// The supply is as it should be.
pub const SUPPLY_NORMAL: Kind = Kind { name: "supply-normal", happen: |rig, _| rig.set_supply_mv(SUPPLY_MV) };
/// A stray write stops the firmware's clock.
pub const FIRMWARE_HANGS: Kind =
    Kind { name: "firmware-hangs", happen: |rig, _| rig.write_register(TIM5_CR1, 0) };
