//! Brown-out reset of the option bytes, off in a factory chip, which then runs outside its specification below 2.4 V
//! with the memory enabled. Level 2 resets below 2.50 V (DS9405, table 22, typical), 0.5 V below the supply's detector:
//! time to store an alarm. The firmware never programs the option bytes: that erases their sector, and a supply failure
//! (a bouncing plug) then leaves read protection and PCROP on. See `docs/bring-up.md` for the debug probe.

use embassy_stm32::pac;

/// Lowest sufficient level: BOR_LEV is 0 for level 3 and 1 for level 2 (RM0090, section 3.9.10).
const LEVEL_2: u8 = 1;

/// Whether it is on, at level 2 or 3.
pub fn has_brown_out_reset() -> bool {
    pac::FLASH.optcr().read().bor_lev() <= LEVEL_2
}
