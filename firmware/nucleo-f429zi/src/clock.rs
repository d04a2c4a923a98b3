//! Clocks of the chip and the board's microseconds.
//!
//! The ST-LINK feeds 8 MHz into HSE; the PLL makes 168 MHz. Timers on APB1 count at 84 MHz, on APB2 at
//! 168 MHz. embassy's time driver keeps the board's time on TIM5 in steps of 1 us.

use embassy_stm32::{
    Config, Peripherals,
    interrupt::Interrupt,
    pac,
    rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
    },
    time::Hertz,
};
use embassy_time::Instant;
use farnear_protocol::BoardMicros;

use crate::registers;

/// Clock of the core.
pub const SYSCLK_HZ: u32 = 168_000_000;
/// Clock of the timers on APB1 (TIM2 to TIM7).
pub const APB1_TIMER_HZ: u32 = 84_000_000;
/// Clock of the timers on APB2 (TIM1, TIM8).
pub const APB2_TIMER_HZ: u32 = 168_000_000;

/// Starts clocks and time driver.
pub fn start() -> Peripherals {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz::mhz(8), mode: HseMode::Bypass });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    critical_section::with(|_| {
        let peripherals = embassy_stm32::init(config);
        // The update event that embassy's time driver makes while it sets TIM5 up also leaves a compare flag.
        // Its handler would take that for "half a period has gone", and the time would be 32 ms ahead.
        pac::TIM5.sr().write(|sr| sr.0 = 0);
        registers::unpend(Interrupt::TIM5);
        peripherals
    })
}

/// Lets the core count its cycles.
pub fn start_cycle_counter() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
}

// Each log line carries the board's time.
defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

/// The board's time.
pub fn now() -> BoardMicros {
    BoardMicros(Instant::now().as_micros())
}

/// The moment whose lower 32 bits are `stamp`, which lies less than 71 minutes before `now`.
pub fn extend(stamp: u32, now: BoardMicros) -> BoardMicros {
    let age = (now.0 as u32).wrapping_sub(stamp);
    BoardMicros(now.0.saturating_sub(u64::from(age)))
}
