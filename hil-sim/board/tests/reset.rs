//! Resets: each has its cause and the next boot number, and nobody acts on requests of an earlier boot.

mod common;

use common::{Bench, request_frame};
use farnear_protocol::{
    EventKind, Request, RequestError,
    message::{Alarm, ResetCause},
};

/// TIM5, which keeps the firmware's time.
const TIM5_CR1: u64 = 0x4000_0c00;

fn check_boot(bench: &mut Bench, boot: u32, cause: ResetCause) {
    let started = bench.events.iter().rev().find(|event| matches!(event.kind, EventKind::Started { .. }));
    assert_eq!(started.expect("the board says that it started").kind, EventKind::Started { cause });
    let hello = bench.say_hello();
    assert_eq!((hello.boot, hello.reset_cause), (boot, cause));
}

#[test]
fn reboot_counts_up_and_its_repeat_is_refused() {
    let mut bench = Bench::new(1);
    let id = bench.send(&Request::Reboot);
    bench.settle();
    check_boot(&mut bench, 2, ResetCause::Software);
    // The repeat of the request of boot 1, as if the answer had been lost.
    bench.rig.send(&request_frame(id, 1, &Request::Reboot)).expect("runs");
    bench.rig.settle().expect("runs");
    assert_eq!(bench.answers(), [(id, Err(RequestError::Boot { current: 2 }))]);
    assert_eq!(bench.report().resets, 1);
}

#[test]
fn the_reset_button_is_told_from_a_request() {
    let mut bench = Bench::new(1);
    bench.home();
    bench.rig.reach_in(|hands| hands.press_reset()).expect("runs");
    bench.settle();
    check_boot(&mut bench, 2, ResetCause::Pin);
    assert_eq!(bench.status().coarse.state, farnear_protocol::message::PositionState::Unknown);
}

#[test]
fn the_watchdog_resets_a_firmware_whose_clock_has_died() {
    let mut bench = Bench::new(1);
    // A stray write stops the timer that wakes the control loop.
    bench.rig.reach_in(|hands| hands.write_register(TIM5_CR1, 0)).expect("runs");
    let before = bench.report().now_ns;
    bench.rig.advance_us(250_000).expect("runs");
    bench.settle();
    check_boot(&mut bench, 2, ResetCause::Watchdog);
    assert_eq!(bench.report().resets, 1);
    let stamps = bench.events.last().expect("started").time.0;
    println!(
        "the watchdog bit within {} ms, started at {stamps} us of its own time",
        (bench.report().now_ns - before) / 1_000_000
    );
    bench.clear(|alarm| *alarm == Alarm::Watchdog);
}
