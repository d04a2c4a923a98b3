//! The board's microseconds and cycles: embassy's time driver keeps the board's time on TIM5 in steps of 1 us.

use embassy_stm32::{Peripherals, interrupt::Interrupt, pac};
use embassy_time::Instant;
use farnear_protocol::BoardMicros;

use crate::{clock_tree, registers};

/// Clock of the core.
pub const SYSCLK_HZ: u32 = 168_000_000;
/// Clock of the timers on APB1 (TIM2 to TIM7).
pub const APB1_TIMER_HZ: u32 = 84_000_000;
/// Clock of the timers on APB2 (TIM1, TIM8).
pub const APB2_TIMER_HZ: u32 = 168_000_000;

/// Starts clocks and time driver.
pub fn start() -> Peripherals {
    critical_section::with(|_| {
        let peripherals = embassy_stm32::init(clock_tree::config());
        accelerate();
        // The update event that embassy's time driver makes while it sets TIM5 up also leaves a compare flag.
        // Its handler would take that for "half a period has gone", and the time would be 32 ms ahead.
        pac::TIM5.sr().write(|sr| sr.0 = 0);
        registers::unpend(Interrupt::TIM5);
        peripherals
    })
}

/// Switches the flash's accelerator on (RM0090, section 3.5.2). embassy sets the wait states by writing the whole register, which
/// switches it off; without it the program is up to 1.9 times slower.
fn accelerate() {
    pac::FLASH.acr().modify(|acr| {
        acr.set_icen(true);
        acr.set_dcen(true);
        acr.set_prften(true);
    });
}

// Each log line carries the board's time.
defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

/// The board's time.
pub fn now() -> BoardMicros {
    BoardMicros(Instant::now().as_micros())
}
