//! The board's microseconds and cycles: embassy's time driver keeps the board's time on TIM5 in steps of 1 us.

use cortex_m::peripheral::DWT;
use embassy_stm32::{Peripherals, interrupt::Interrupt, pac};
use embassy_time::Instant;
use farnear_protocol::BoardMicros;

use crate::{clock_tree, registers};

pub const SYSCLK_HZ: u32 = 168_000_000;
/// Clock of the timers on APB1 (TIM2 to TIM7).
pub const APB1_TIMER_HZ: u32 = 84_000_000;
/// Clock of the timers on APB2 (TIM1, TIM8).
pub const APB2_TIMER_HZ: u32 = 168_000_000;

/// How often the clock from outside is looked for, and cycles of the chip's own 16 MHz in between: 0.2 s in all. How long an
/// ST-LINK takes until it feeds it is not published (not checked).
const LOOKS: u32 = 20_000;
const BETWEEN_LOOKS: u32 = 160;

/// Waits for this many cycles of the core, by its cycle counter: a counting loop takes two to four cycles a count.
pub fn wait_cycles(cycles: u32) {
    wait_cycles_since(DWT::cycle_count(), cycles);
}

/// Waits until this many cycles have passed since `start`.
pub fn wait_cycles_since(start: u32, cycles: u32) {
    loop {
        let left = cycles.saturating_sub(DWT::cycle_count().wrapping_sub(start));
        if left == 0 {
            return;
        }
        // A quarter of it is never too long, and leaves the bus alone meanwhile.
        cortex_m::asm::delay(left / 4);
    }
}

/// Whether the clock from outside comes. embassy would wait for it for ever, and the watchdog is not awake yet. From here on one that
/// stops breaks the motors' timers and resets the board (RM0090, section 6.2.7).
fn has_outer_clock() -> bool {
    // The one counts only as long as the other is off (section 6.3.1).
    pac::RCC.cr().modify(|cr| cr.set_hsebyp(true));
    pac::RCC.cr().modify(|cr| cr.set_hseon(true));
    let comes = (0..LOOKS).any(|_| {
        wait_cycles(BETWEEN_LOOKS);
        pac::RCC.cr().read().hserdy()
    });
    pac::RCC.cr().modify(|cr| cr.set_csson(comes));
    comes
}

/// Starts clocks and time driver; gives whether the chip runs on its own clock. One that was `lost` in the boot before is not looked
/// for: a loose wire would reset the board again and again.
pub fn start(lost: bool) -> (Peripherals, bool) {
    let own_clock = lost || !has_outer_clock();
    let peripherals = critical_section::with(|_| {
        let peripherals = embassy_stm32::init(clock_tree::config(own_clock));
        accelerate();
        // The update event that embassy's time driver makes while it sets TIM5 up also leaves a compare flag.
        // Its handler would take that for "half a period has gone", and the time would be 32 ms ahead.
        pac::TIM5.sr().write(|sr| sr.0 = 0);
        registers::unpend(Interrupt::TIM5);
        peripherals
    });
    (peripherals, own_clock)
}

/// Wait states of the flash at 168 MHz down to 2.4 V (RM0090, section 3.5.1): below the brown-out reset of level 2. Five are
/// enough above 2.7 V only.
const LATENCY: embassy_stm32::pac::flash::vals::Latency = embassy_stm32::pac::flash::vals::Latency::WS6;

/// Switches the flash's accelerator on (RM0090, section 3.5.2). embassy sets the wait states by writing the whole register, which
/// switches it off; without it the program is up to 1.9 times slower.
fn accelerate() {
    pac::FLASH.acr().modify(|acr| {
        acr.set_latency(LATENCY);
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
