//! The way out of a panic, of a fault and of a lost clock: last words into retained memory, then a reset. The motors' timers stop with
//! the reset, so the last STEP pulse comes before anything else happens.

use core::{arch::naked_asm, panic::PanicInfo};

use cortex_m::peripheral::SCB;

use super::retained::{Last, leave};

/// The stack, see `memory.x`: a fault with the stack pointer this close to its lower end, or below, is an overflow.
const STACK_LOWEST: u32 = 0x2000_0000;
const STACK_MARGIN: u32 = 128;
/// Below the stack, down to the option bytes, there is nothing (RM0090, section 2.3), so the bus answers every access
/// with an error. These 16 KiB are more than any frame of the running program (10 KiB); the one of the start (29 KiB) is
/// made once, on an empty stack.
const NOTHING: core::ops::Range<u32> = 0x1fff_c010..STACK_LOWEST;
/// Words of a stacked exception frame before the program counter.
const FRAME_PC: u32 = 6;
/// Of the configurable fault status register (ARMv7-M, B3.2.15): the bus refused the processor's frame on the stack;
/// the address that the bus refused is known.
const STACKING_FAILED: u32 = 1 << 12;
const ADDRESS_VALID: u32 = 1 << 15;
/// Where that address stands (B3.2.18).
const BFAR: *const u32 = 0xe000_ed38 as *const u32;
/// Configurable fault status register.
const CFSR: *const u32 = 0xe000_ed28 as *const u32;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let place = info.location();
    // Locations are constants of the program, but their type does not say so; the pointer is checked when it is read.
    let file = place.map(|place| place.file());
    // SAFETY: `Location` of a panic in this program points into its flash (compiled-in constants).
    let file = file.map(|file| unsafe { core::mem::transmute::<&str, &'static str>(file) });
    leave(Last::Panic { file, line: place.map_or(0, |place| place.line()) });
    SCB::sys_reset()
}

/// The clock security system's interrupt: the clock from outside has stopped, and the chip runs on its own 16 MHz. The motors' timers
/// have had their break with it.
// SAFETY: it returns to nothing. Retained memory that was just being written is not believed by `leave` nor after the reset.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() -> ! {
    cortex_m::interrupt::disable();
    leave(Last::ClockLost);
    SCB::sys_reset()
}

/// Every fault comes here (the configurable ones are not enabled and escalate). The stack may be full, so it is given up
/// first: nothing goes back to where the fault was. `r0` is the stack pointer of the fault, which cortex-m-rt's trampoline
/// has found.
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
    // A write that the bus refuses too late to name its address still leaves the stack pointer where it was made.
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
