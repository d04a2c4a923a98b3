//! Failure of the ST-LINK's HSE clock: never ready, and the clock security system's NMI (RM0090, section 6.2.7).

use std::sync::atomic::{AtomicBool, Ordering};

use rigless::{
    emulator::{Access, AccessKind, Processor},
    soc::Width,
    time::VirtualNanos,
};

/// RCC_CR and HSERDY (RM0090, section 6.3.1).
const RCC_CR: u64 = 0x4002_3800;
const HSERDY: u64 = 1 << 17;
/// ICSR and NMIPENDSET (ARMv7-M, B3.2.4).
const ICSR: u64 = 0xe000_ed04;
const NMIPENDSET: u64 = 1 << 31;

#[derive(Default, Debug)]
pub struct OuterClock {
    dead: AtomicBool,
    failure: AtomicBool,
}

impl OuterClock {
    /// Returns whether the clock changed.
    pub fn set(&self, there: bool) -> bool {
        self.dead.swap(!there, Ordering::Relaxed) == there
    }

    /// Requests the clock security system's interrupt.
    pub fn tell(&self) {
        self.failure.store(true, Ordering::Relaxed);
    }

    /// A reset cancels a pending interrupt.
    pub fn forget(&self) {
        self.failure.store(false, Ordering::Relaxed);
    }

    /// Returns whether it came: from now on the internal oscillator clocks the processor.
    pub fn interrupt(&self, processor: &mut dyn Processor, now: VirtualNanos) -> bool {
        let failed = self.failure.swap(false, Ordering::Relaxed);
        if failed {
            processor.debugger_access(Some(NMIPENDSET), ICSR, Width::W32, now);
        }
        failed
    }

    pub fn seen(&self, access: &Access, value: u64) -> u64 {
        let asks = access.address == RCC_CR && access.kind == AccessKind::Read;
        if asks && self.dead.load(Ordering::Relaxed) { value & !HSERDY } else { value }
    }
}
