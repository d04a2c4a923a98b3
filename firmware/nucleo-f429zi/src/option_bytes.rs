//! The option bytes: the brown-out reset, which a chip from the factory has off.
//!
//! Without it the chip runs out of its specification between 2.7 V and 1.7 V, with the memory still enabled. With level 3
//! it is held in reset below 2.83 V (DS9405, table 22, typical; the supply's detector speaks up at 2.93 V before that).

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;

/// Level 3 of BOR_LEV (RM0090, section 3.9.10).
const LEVEL: u8 = 0;
/// Unlocks the option bytes (section 3.7.2).
const KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

/// Sees to it that the brown-out reset is on; gives whether it is. Where it was not, it is programmed, and the chip reset, for
/// the option bytes count from a reset on: call before anything else is done. Not again after a reset by the program
/// itself: bytes that cannot be written must not keep the board from starting.
pub fn demand_brown_out_reset() -> bool {
    let flash = pac::FLASH;
    if flash.optcr().read().bor_lev() == LEVEL {
        return true;
    }
    if pac::RCC.csr().read().sftrstf() {
        return false;
    }
    KEYS.into_iter().for_each(|key| flash.optkeyr().write_value(key));
    flash.optcr().modify(|options| options.set_bor_lev(LEVEL));
    flash.optcr().modify(|options| options.set_optstrt(true));
    while flash.sr().read().bsy() {}
    SCB::sys_reset()
}
