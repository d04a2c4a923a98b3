//! The supply, watched by the chip's own detector (RM0090, section 5.2.2).

use embassy_stm32::pac;

/// Level 6: low below 2.93 V, fine again above 3.03 V (DS9405, table 22). The board's regulator gives 3.3 V, so this is
/// the fall of the supply seen early; the brown-out reset comes later.
const LEVEL: u8 = 6;

/// The detector.
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
