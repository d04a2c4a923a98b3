//! Exit from a panic, a fault or a lost clock: retains the cause and resets, which stops the motors' timers first.

use core::{arch::naked_asm, panic::PanicInfo};

use cortex_m::peripheral::SCB;

use super::retained::{Last, leave};
use crate::{light, piezo};

/// Stack limit, see `memory.x`: a fault with the stack pointer near or below it is an overflow.
const STACK_LOWEST: u32 = 0x2000_0000;
const STACK_MARGIN: u32 = 128;
/// The bus returns errors below the stack, down to the option bytes (RM0090, section 2.3). These 16 KiB exceed any
/// frame of the running program (10 KiB); the start's (29 KiB) is built on an empty stack.
const NOTHING: core::ops::Range<u32> = 0x1fff_c010..STACK_LOWEST;
/// Words of an exception frame before the program counter.
const FRAME_PC: u32 = 6;
/// Bits of CFSR (ARMv7-M, B3.2.15): stacking failed; BFAR is valid.
const STACKING_FAILED: u32 = 1 << 12;
const ADDRESS_VALID: u32 = 1 << 15;
/// B3.2.18.
const BFAR: *const u32 = 0xe000_ed38 as *const u32;
const CFSR: *const u32 = 0xe000_ed28 as *const u32;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let place = info.location();
    // `Location`s are constants, though not by type; the pointer is checked when read.
    let file = place.map(|place| place.file());
    // SAFETY: `Location` of a panic in this program points into its flash (compiled-in constants).
    let file = file.map(|file| unsafe { core::mem::transmute::<&str, &'static str>(file) });
    leave(Last::Panic { file, line: place.map_or(0, |place| place.line()) });
    SCB::sys_reset()
}

/// Clock security interrupt: the external clock has stopped, which broke the motors' timers; the internal one is used.
/// The supply may end next, so light and piezo do not wait for the start.
// SAFETY: it never returns. Retained memory that was being written is rejected by `leave` and after the
// reset.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() -> ! {
    cortex_m::interrupt::disable();
    leave(Last::ClockLost);
    light::off();
    piezo::release();
    SCB::sys_reset()
}

/// All faults (configurable ones escalate). Resets the stack first: it may be full. `r0`: cortex-m-rt's stack pointer.
// SAFETY: the name is cortex-m-rt's hook for this; there is no other.
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[unsafe(link_section = ".HardFault.user")]
extern "C" fn HardFault() {
    naked_asm!("ldr r1, =_stack_start", "mov sp, r1", "b {0}", sym fault)
}

extern "C" fn fault(stack: u32) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: registers of the core, readable at any time.
    let (status, address) = unsafe { (CFSR.read_volatile(), BFAR.read_volatile()) };
    // An imprecise bus error has no address, but the stack pointer is still where it occurred.
    let beyond = status & ADDRESS_VALID != 0 && NOTHING.contains(&address);
    let last = if beyond || status & STACKING_FAILED != 0 || stack < STACK_LOWEST + STACK_MARGIN {
        Last::StackOverflow
    } else {
        // SAFETY: the processor has just stacked its frame there, above the stack's lower end.
        let program_counter = unsafe { (stack as *const u32).add(FRAME_PC as usize).read_volatile() };
        Last::Fault { program_counter, status }
    };
    leave(last);
    SCB::sys_reset()
}
