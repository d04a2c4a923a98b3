//! The supply, watched by the chip's own detector (RM0090, section 5.2.2).

use embassy_stm32::pac;

/// Level 7, the highest: low below 3.03 V, fine again above 3.14 V (DS9405, table 22, typical). The brown-out reset of level 2
/// follows at 2.50 V; `docs/rig.md` has the capacitor that makes the time between them long enough for a record.
const LEVEL: u8 = 7;

pub struct Supply(());

impl Supply {
    /// Switches the detector on; the clocks are up, so its own is too.
    pub fn new() -> Self {
        pac::PWR.cr1().modify(|w| {
            w.set_pls(LEVEL);
            w.set_pvde(true);
        });
        Self(())
    }

    /// Below the level at which the board can still stop in order.
    pub fn is_low(&self) -> bool {
        pac::PWR.csr1().read().pvdo()
    }
}
