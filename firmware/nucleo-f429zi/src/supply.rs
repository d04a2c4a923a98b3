//! Supply detector of the chip (RM0090, section 5.2.2).

use embassy_stm32::pac;

/// Level 7: low below 3.03 V, released above 3.14 V (DS9405, table 22, typical). `docs/rig.md` has the capacitor.
const LEVEL: u8 = 7;

pub struct Supply(());

impl Supply {
    pub fn new() -> Self {
        pac::PWR.cr1().modify(|w| {
            w.set_pls(LEVEL);
            w.set_pvde(true);
        });
        Self(())
    }

    /// Whether the supply is too low for an orderly stop.
    pub fn is_low(&self) -> bool {
        pac::PWR.csr1().read().pvdo()
    }
}
