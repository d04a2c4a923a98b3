//! Board microseconds and cycles: embassy's time driver runs on TIM5 in steps of 1 us.

use cortex_m::peripheral::DWT;
use embassy_stm32::{Peripherals, interrupt::Interrupt, pac};
use embassy_time::Instant;
use farnear_protocol::BoardMicros;

use crate::{clock_tree, registers};

pub const SYSCLK_HZ: u32 = 168_000_000;
/// TIM2 to TIM7.
pub const APB1_TIMER_HZ: u32 = 84_000_000;
/// TIM1, TIM8.
pub const APB2_TIMER_HZ: u32 = 168_000_000;

/// Polls for the external clock, and cycles in between: 0.2 s, as an ST-LINK's start-up time is unpublished.
const LOOKS: u32 = 20_000;
const BETWEEN_LOOKS: u32 = 160;

/// Waits by the cycle counter: a counting loop takes two to four cycles a count.
pub fn wait_cycles(cycles: u32) {
    wait_cycles_since(DWT::cycle_count(), cycles);
}

pub fn wait_cycles_since(start: u32, cycles: u32) {
    loop {
        let left = cycles.saturating_sub(DWT::cycle_count().wrapping_sub(start));
        if left == 0 {
            return;
        }
        // A quarter is never too long and leaves the bus free.
        cortex_m::asm::delay(left / 4);
    }
}

/// embassy would wait forever for a missing external clock, with the watchdog stopped. From here on a failing clock
/// breaks the motors' timers and resets the board (RM0090, section 6.2.7).
fn has_outer_clock() -> bool {
    // HSEBYP requires HSEON = 0 (section 6.3.1).
    pac::RCC.cr().modify(|cr| cr.set_hsebyp(true));
    pac::RCC.cr().modify(|cr| cr.set_hseon(true));
    let comes = (0..LOOKS).any(|_| {
        wait_cycles(BETWEEN_LOOKS);
        pac::RCC.cr().read().hserdy()
    });
    pac::RCC.cr().modify(|cr| cr.set_csson(comes));
    comes
}

/// Returns whether the internal clock is used. A clock `lost` in the last boot may reset again and is not tried.
pub fn start(lost: bool) -> (Peripherals, bool) {
    let own_clock = lost || !has_outer_clock();
    let peripherals = critical_section::with(|_| {
        let peripherals = embassy_stm32::init(clock_tree::config(own_clock));
        accelerate();
        // embassy's update event while setting up TIM5 leaves a compare flag, whose handler would add 32 ms.
        pac::TIM5.sr().write(|sr| sr.0 = 0);
        registers::unpend(Interrupt::TIM5);
        peripherals
    });
    (peripherals, own_clock)
}

/// Flash wait states at 168 MHz down to 2.4 V (RM0090, section 3.5.1), below brown-out level 2.
const LATENCY: embassy_stm32::pac::flash::vals::Latency = embassy_stm32::pac::flash::vals::Latency::WS6;

/// Enables the flash accelerator (RM0090, section 3.5.2), which embassy disables: up to 1.9 times faster.
fn accelerate() {
    pac::FLASH.acr().modify(|acr| {
        acr.set_latency(LATENCY);
        acr.set_icen(true);
        acr.set_dcen(true);
        acr.set_prften(true);
    });
}

// Board time in each log line.
defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

pub fn now() -> BoardMicros {
    BoardMicros(Instant::now().as_micros())
}
