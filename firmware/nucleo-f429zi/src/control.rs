//! Timing of the control loop ([`farnear_rig::control`]): a tick every 200 us, 2 ms at rest, its duration, and a LED.

use cortex_m::peripheral::DWT;
use defmt::warn;
use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    peripherals::PB0,
};
use embassy_time::{Duration, Instant, Timer};
use farnear_rig::{
    Rig,
    control::Control,
    io::{TICK_HZ, TICK_US},
};

use crate::{board::Nucleo, clock::SYSCLK_HZ, registers};

const BLINK: u32 = TICK_HZ / 2;
/// Longer ticks are logged: three quarters of the period.
const LONG_TICK_CYCLES: u32 = SYSCLK_HZ / 1_000_000 * TICK_US * 3 / 4;

pub async fn run(mut board: Nucleo, rig: &mut Rig, led: Peri<'static, PB0>) -> ! {
    registers::retained::set_boot(rig.boot());
    let mut led = Output::new(led, Level::High, Speed::Low);
    let mut control = Control::new(rig);
    board.wake_watchdog();
    let mut blink = BLINK;
    let mut due = Instant::now();
    let mut ticks = 1;
    loop {
        // Late ticks are caught up.
        due += Duration::from_micros(u64::from(ticks * TICK_US));
        Timer::at(due).await;
        let begin = DWT::cycle_count();
        blink = blink.saturating_sub(ticks);
        if blink == 0 {
            led.toggle();
            blink = BLINK;
        }
        ticks = control.tick(&mut board);
        let cycles = DWT::cycle_count().wrapping_sub(begin);
        if registers::note_tick(cycles) && cycles > LONG_TICK_CYCLES {
            warn!("the longest tick so far: {} cycles", cycles);
        }
    }
}
