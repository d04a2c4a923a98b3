//! The clock that the ST-LINK feeds into HSE where it fails, as far as the emulator's part does not know of it: an HSE that never becomes
//! ready, and the clock security system's interrupt, which cannot be masked (RM0090, section 6.2.7).

use std::sync::atomic::{AtomicBool, Ordering};

use rigless::{
    emulator::{Access, AccessKind, Processor},
    soc::Width,
    time::VirtualNanos,
};

/// RCC_CR and its bit HSERDY (RM0090, section 6.3.1).
const RCC_CR: u64 = 0x4002_3800;
const HSERDY: u64 = 1 << 17;
/// The interrupt control and state register and its bit NMIPENDSET (ARMv7-M, B3.2.4).
const ICSR: u64 = 0xe000_ed04;
const NMIPENDSET: u64 = 1 << 31;

/// The clock, as chip and processor see it.
#[derive(Default, Debug)]
pub struct OuterClock {
    dead: AtomicBool,
    failure: AtomicBool,
}

impl OuterClock {
    /// It stops, or comes back; whether that is news.
    pub fn set(&self, there: bool) -> bool {
        self.dead.swap(!there, Ordering::Relaxed) == there
    }

    /// The clock security system has seen it stop.
    pub fn tell(&self) {
        self.failure.store(true, Ordering::Relaxed);
    }

    /// A reset: what the processor has not been told it never hears.
    pub fn forget(&self) {
        self.failure.store(false, Ordering::Relaxed);
    }

    /// Lets a processor in that is to be told, before its next instruction.
    pub fn interrupt(&self, processor: &mut dyn Processor, now: VirtualNanos) {
        if self.failure.swap(false, Ordering::Relaxed) {
            processor.debugger_access(Some(NMIPENDSET), ICSR, Width::W32, now);
        }
    }

    /// What a register of the chip reads as.
    pub fn seen(&self, access: &Access, value: u64) -> u64 {
        let asks = access.address == RCC_CR && access.kind == AccessKind::Read;
        if asks && self.dead.load(Ordering::Relaxed) { value & !HSERDY } else { value }
    }
}
