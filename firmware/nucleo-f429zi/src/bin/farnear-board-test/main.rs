//! # farnear-board-test
//!
//! Tests a real NUCLEO-F429ZI with four jumper wires and no rig; `docs/bring-up.md` has the wires, `cargo xtask board-test`
//! runs it, also on the emulated board. It overflows the stack and lets the watchdog bite, each time continuing after the
//! reset, then tests the drivers and repeats its report at each link rate. A line of the report: name, tab, `pass`,
//! `fail` or `skip`, tab, what was measured.
#![no_std]
#![no_main]

mod checks;

use core::{fmt::Write, hint::black_box};

use embassy_executor::Spawner;
use embassy_stm32::{
    interrupt::{Interrupt, InterruptExt, Priority},
    peripherals::IWDG,
    uid,
    wdg::IndependentWatchdog,
};
use embassy_time::{Duration, Instant, block_for};
use farnear_nucleo_f429zi::{
    board::{Nucleo, Parts},
    clock,
    link::Link,
    registers::{
        self,
        retained::{self, Last},
    },
};
use farnear_protocol::message::{LinkRate, ResetCause};
use heapless::String;

/// Retained boot numbers: the stack overflow was tried; the watchdog was, after an overflow that was reported or not.
const OVERFLOWED: u32 = 0x00b0_a000;
const BITTEN: u32 = 0x00b0_b000;
const BITTEN_WITHOUT_OVERFLOW: u32 = 0x00b0_c000;
const WATCHDOG_US: u32 = 100_000;
/// The internal oscillator has 17 to 47 kHz (DS9405).
const WATCHDOG_MS: core::ops::RangeInclusive<u32> = 68..=188;
/// Bytes that the host sends for each `listen` line, counting up.
const PATTERN: u32 = 256;
const LISTEN: Duration = Duration::from_millis(300);

pub type Report = String<1536>;

#[derive(Clone, Copy)]
pub enum Verdict {
    Pass,
    Fail,
    Skip,
}

impl From<bool> for Verdict {
    fn from(passed: bool) -> Self {
        if passed { Self::Pass } else { Self::Fail }
    }
}

pub fn tell(report: &mut Report, name: &str, verdict: impl Into<Verdict>, what: core::fmt::Arguments<'_>) {
    let verdict = match verdict.into() {
        Verdict::Pass => "pass",
        Verdict::Fail => "fail",
        Verdict::Skip => "skip",
    };
    // A full report lacks its end line, which the host notices.
    let _ = writeln!(report, "{name}\t{verdict}\t{what}");
}

#[inline(never)]
fn overflow(depth: u32) -> u32 {
    let frame = black_box([depth; 64]);
    if depth == u32::MAX { frame[0] } else { overflow(depth + 1).wrapping_add(frame[63]) }
}

fn let_the_watchdog_bite(watchdog: embassy_stm32::Peri<'static, IWDG>) -> ! {
    let mut watchdog = IndependentWatchdog::new(watchdog, WATCHDOG_US);
    watchdog.unleash();
    // The counter takes its reload value with the first feed; its registers take five cycles of 32 kHz to change.
    block_for(Duration::from_millis(1));
    watchdog.pet();
    let begin = Instant::now();
    loop {
        retained::keep_piezo_code(begin.elapsed().as_millis() as u16);
    }
}

fn send(link: &mut Link, text: &str) {
    for part in text.as_bytes().chunks(64) {
        while !link.has_room() {
            let _ = link.drain(|_| {});
        }
        link.send(part);
    }
    while !link.is_idle() {
        let _ = link.drain(|_| {});
    }
}

/// Listens for the host's bytes at each rate, then sends the report.
fn speak(link: &mut Link, report: &str) -> ! {
    loop {
        for rate in LinkRate::ALL {
            link.set_rate(rate);
            let mut line = Report::new();
            let _ = writeln!(line, "\nlisten\t{}", rate.baud());
            send(link, &line);
            let (mut count, mut wrong) = (0u32, 0u32);
            let until = Instant::now() + LISTEN;
            while Instant::now() < until {
                let lost = link.drain(|byte| {
                    wrong += u32::from(u32::from(byte) != count % PATTERN);
                    count += 1;
                });
                wrong += u32::from(lost);
            }
            line.clear();
            let baud = rate.baud();
            let passed = count == PATTERN && wrong == 0;
            tell(
                &mut line,
                "link",
                passed,
                format_args!("{baud} baud: {count} of {PATTERN} bytes, {wrong} wrong"),
            );
            send(link, report);
            let _ = writeln!(line, "end\t{baud}");
            send(link, &line);
        }
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let cause = registers::take_reset_cause();
    let (boot, last) = retained::take();
    let watchdog_ms = u32::from(retained::piezo_code().unwrap_or(0));
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
    let (p, own_clock) = clock::start(false);
    Interrupt::TIM5.set_priority(Priority::P3);
    // `take` adds one.
    match boot.wrapping_sub(1) {
        OVERFLOWED => {
            let reported = last == Some(Last::StackOverflow);
            retained::set_boot(if reported { BITTEN } else { BITTEN_WITHOUT_OVERFLOW });
            let_the_watchdog_bite(p.IWDG)
        }
        BITTEN | BITTEN_WITHOUT_OVERFLOW => {}
        _ => {
            retained::set_boot(OVERFLOWED);
            block_for(Duration::from_millis(1));
            black_box(overflow(0));
        }
    }
    let mut report = Report::new();
    let _ = writeln!(report, "farnear-board-test\t{}\t{:02x?}", env!("CARGO_PKG_VERSION"), uid::uid());
    let overflow_reported = boot.wrapping_sub(1) == BITTEN;
    tell(
        &mut report,
        "stack overflow",
        overflow_reported,
        format_args!("a bus fault below the stack, and a reset"),
    );
    let bitten = cause == ResetCause::Watchdog && WATCHDOG_MS.contains(&watchdog_ms);
    tell(
        &mut report,
        "watchdog",
        bitten,
        format_args!("{watchdog_ms} ms, expected 68 to 188; cause {cause:?}"),
    );
    // The next reset begins anew.
    retained::set_boot(0);
    match Nucleo::set_up(p) {
        Ok(Parts { mut board, emulated, .. }) => {
            checks::run(&mut board, &mut report, own_clock, emulated);
            speak(board.link(), &report)
        }
        // Without the port nothing can be told.
        Err(_) => loop {
            cortex_m::asm::wfi();
        },
    }
}
