//! The only `unsafe` code of the firmware: interrupt enables, the memory that survives a reset, the way out of a fault, the
//! log's encoder, and the names under which a debugger finds what was measured.
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

/// Cycles of the longest control tick since the reset, interrupts included; a debugger (and the emulated board's
/// tests) find it by its name.
// SAFETY: no other symbol has this name.
#[unsafe(no_mangle)]
static FARNEAR_LONGEST_TICK_CYCLES: AtomicU32 = AtomicU32::new(0);

/// Notes how long a tick took; `true` where it is the longest so far.
pub fn note_tick(cycles: u32) -> bool {
    let longest = cycles > FARNEAR_LONGEST_TICK_CYCLES.load(Ordering::Relaxed);
    if longest {
        FARNEAR_LONGEST_TICK_CYCLES.store(cycles, Ordering::Relaxed);
    }
    longest
}

/// Lets an interrupt in, at a priority. Call when its handler's state is ready.
pub fn enable_interrupt(interrupt: Interrupt, priority: Priority) {
    interrupt.set_priority(priority);
    interrupt.unpend();
    // SAFETY: no critical section of this program relies on an interrupt being masked; they mask all.
    unsafe { interrupt.enable() };
}

/// Forgets a request of an interrupt that was set before its cause was cleared.
pub fn unpend(interrupt: Interrupt) {
    NVIC::unpend(interrupt);
}

/// Why the board was reset; clears the flags, so that the next reset shows its own (RM0090, RCC_CSR).
pub fn take_reset_cause() -> ResetCause {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|csr| csr.set_rmvf(true));
    // From the special to the general: every reset also sets PINRSTF, power-on sets BORRSTF too. Power-on comes before a
    // reset of the program's: that of the option bytes clears no flag.
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
