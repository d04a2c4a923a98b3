//! The option bytes: the brown-out reset, which a chip from the factory has off.
//!
//! Without it the chip runs out of its specification below 2.4 V, with the memory still enabled. Level 2 holds it in reset below
//! 2.50 V (DS9405, table 22, typical): 0.5 V below the supply's detector, which leaves time to store an alarm.
//!
//! The firmware reads the option bytes and never programs them. Programming erases their sector first; a supply that fails in
//! that moment leaves read protection and PCROP on. Right after power-on, while a plug still bounces, is the worst moment for it.
//! `docs/bring-up.md` has the step with the debug probe.

use embassy_stm32::pac;

/// The lowest level that is enough: BOR_LEV is 0 for level 3 and 1 for level 2 (RM0090, section 3.9.10).
const LEVEL_2: u8 = 1;

/// Whether the brown-out reset is on, at level 2 or 3.
pub fn has_brown_out_reset() -> bool {
    pac::FLASH.optcr().read().bor_lev() <= LEVEL_2
}
