//! The only `unsafe` code of the firmware: interrupt enables and the memory that survives a reset.
#![allow(unsafe_code)]

use core::{cell::UnsafeCell, mem::MaybeUninit};

use cortex_m::peripheral::NVIC;
use embassy_stm32::{
    interrupt::{Interrupt, InterruptExt, Priority},
    pac,
};
use farnear_protocol::message::ResetCause;

/// Says that the retained memory holds a boot number and not what was there at power-on ("fnBT").
const MAGIC: u32 = 0x666e_4254;

/// What survives a reset, but not a loss of power: [magic, boot number, check].
struct Retained(UnsafeCell<MaybeUninit<[u32; 3]>>);

// SAFETY: `next_boot_number` is the only access, and it runs inside a critical section.
unsafe impl Sync for Retained {}

// SAFETY: `.uninit` is a section of cortex-m-rt's linker script that start-up code leaves alone; it has no
// initial value, which `MaybeUninit` says.
#[unsafe(link_section = ".uninit.boot")]
static RETAINED: Retained = Retained(UnsafeCell::new(MaybeUninit::uninit()));

fn check(boot: u32) -> u32 {
    !boot.rotate_left(16)
}

/// The number of this boot: one more than the last, or 1 after a loss of power. Never 0, which means "not
/// known" on the wire. Call once per boot.
pub fn next_boot_number() -> u32 {
    critical_section::with(|_| {
        let place = RETAINED.0.get().cast::<[u32; 3]>();
        // SAFETY: the place is valid, aligned static memory that nobody else touches (critical section). Any
        // bits are a valid [u32; 3]; volatile, so that the compiler cannot reason from "uninitialised".
        let [magic, last, sum] = unsafe { place.read_volatile() };
        let known = magic == MAGIC && sum == check(last);
        let boot = if known { last.wrapping_add(1).max(1) } else { 1 };
        // SAFETY: as above.
        unsafe { place.write_volatile([MAGIC, boot, check(boot)]) };
        boot
    })
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
    // From the special to the general: every reset also sets PINRSTF, power-on sets BORRSTF too.
    if flags.lpwrrstf() {
        ResetCause::LowPower
    } else if flags.wdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.borrstf() {
        ResetCause::BrownOut
    } else if flags.padrstf() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    }
}
