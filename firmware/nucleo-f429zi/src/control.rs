//! The control loop's clockwork: a tick every 200 us, how long each took, and a LED. What a tick does is
//! [`farnear_rig::control`]'s.

use cortex_m::peripheral::DWT;
use defmt::warn;
use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    peripherals::PB0,
};
use embassy_time::{Duration, Ticker};
use farnear_rig::{
    Rig,
    control::Control,
    io::{TICK_HZ, TICK_US},
};

use crate::{board::Nucleo, clock::SYSCLK_HZ, registers};

/// Ticks of half a period of the LED that shows that the loop runs.
const BLINK: u32 = TICK_HZ / 2;
/// A tick this long is worth a line in the log: three quarters of its period.
const LONG_TICK_CYCLES: u32 = SYSCLK_HZ / 1_000_000 * TICK_US * 3 / 4;

/// Runs the rig for ever.
pub async fn run(mut board: Nucleo, rig: &mut Rig, led: Peri<'static, PB0>) -> ! {
    registers::retained::set_boot(rig.boot());
    let mut led = Output::new(led, Level::High, Speed::Low);
    let mut control = Control::new(rig);
    board.wake_watchdog();
    let mut blink = BLINK;
    let mut ticker = Ticker::every(Duration::from_micros(u64::from(TICK_US)));
    loop {
        ticker.next().await;
        let begin = DWT::cycle_count();
        control.tick(&mut board);
        blink -= 1;
        if blink == 0 {
            led.toggle();
            blink = BLINK;
        }
        let cycles = DWT::cycle_count().wrapping_sub(begin);
        if registers::note_tick(cycles) && cycles > LONG_TICK_CYCLES {
            warn!("the longest tick so far: {} cycles", cycles);
        }
    }
}
