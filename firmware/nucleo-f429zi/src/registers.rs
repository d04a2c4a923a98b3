//! All `unsafe` code of the firmware: interrupt enables, retained memory, fault exit, log encoder, debugger symbols.
#![allow(unsafe_code)]

mod faults;
mod logger;
pub mod retained;

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use embassy_stm32::{
    interrupt::{Interrupt, InterruptExt, Priority},
    pac,
};
use farnear_protocol::message::ResetCause;

pub use self::logger::take_log;

/// Cycles of the longest control tick since the reset, with interrupts; for debuggers and the emulated board's tests.
// SAFETY: no other symbol has this name.
#[unsafe(no_mangle)]
static FARNEAR_LONGEST_TICK_CYCLES: AtomicU32 = AtomicU32::new(0);

/// Records a tick's duration; `true` if it is the longest so far.
pub fn note_tick(cycles: u32) -> bool {
    let longest = cycles > FARNEAR_LONGEST_TICK_CYCLES.load(Ordering::Relaxed);
    if longest {
        FARNEAR_LONGEST_TICK_CYCLES.store(cycles, Ordering::Relaxed);
    }
    longest
}

/// Enables an interrupt; its handler's state must be ready.
pub fn enable_interrupt(interrupt: Interrupt, priority: Priority) {
    interrupt.set_priority(priority);
    interrupt.unpend();
    // SAFETY: no critical section of this program relies on an interrupt being masked; they mask all.
    unsafe { interrupt.enable() };
}

/// Clears a pending interrupt whose cause was cleared later.
pub fn unpend(interrupt: Interrupt) {
    NVIC::unpend(interrupt);
}

/// Reads and clears the reset flags (RM0090, RCC_CSR).
pub fn take_reset_cause() -> ResetCause {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|csr| csr.set_rmvf(true));
    // From specific to general: each reset also sets PINRSTF, power-on also BORRSTF. Power-on precedes the
    // program's reset, because the option bytes' reset clears no flag.
    if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.lpwrrstf() {
        ResetCause::LowPower
    } else if flags.wdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.borrstf() {
        ResetCause::BrownOut
    } else if flags.padrstf() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    }
}
