//! Each reset reports its cause and boot number, ignores older requests and latches an alarm if severe.

use std::collections::HashSet;

use crate::bench::{Bench, go, request_frame, symbols};
use farnear_protocol::{
    EventKind, Request, RequestError,
    message::{Alarm, Axis, PositionState, ResetCause},
};
use farnear_sim::RigAccess;
use object::{ObjectSymbol, SymbolKind};

/// TIM5 is the firmware's time base.
const TIM5_CR1: u64 = 0x4000_0c00;

fn check_boot(bench: &mut Bench, boot: u32, cause: ResetCause) {
    let started = bench.events.iter().rev().find(|event| matches!(event.kind, EventKind::Started { .. }));
    assert_eq!(started.expect("a started event").kind, EventKind::Started { cause });
    let hello = bench.say_hello();
    assert_eq!((hello.boot, hello.reset_cause), (boot, cause));
}

#[test]
fn a_reboot_counts_up_and_refuses_its_repeat() {
    let mut bench = Bench::new(1);
    let id = bench.send(&Request::Reboot);
    bench.settle();
    check_boot(&mut bench, 2, ResetCause::Software);
    // Repeats the request of boot 1, as after a lost answer.
    bench.rig.send(&request_frame(id, 1, &Request::Reboot)).expect("runs");
    bench.rig.settle().expect("runs");
    assert_eq!(bench.answers(), [(id, Err(RequestError::Boot { current: 2 }))]);
    assert_eq!(bench.report().resets, 1);
    assert_eq!(bench.alarm(), None, "nothing went wrong");
}

#[test]
fn distinguishes_the_reset_button_from_a_request() {
    let mut bench = Bench::near_home(1);
    bench.home_axis(Axis::SensorCoarse);
    // The motor is at rest and the position stored.
    bench.rig.advance_us(200_000).expect("runs");
    bench.access(|rig| rig.press_reset());
    bench.settle();
    check_boot(&mut bench, 2, ResetCause::Pin);
    assert_eq!(bench.status().coarse.state, PositionState::Unknown);
    assert_eq!(bench.alarm(), None, "it stood still");
}

/// The alarm survives further resets and is cleared only by its number.
fn leaves_an_alarm(
    happen: impl FnOnce(&mut RigAccess<'_, '_>) + Send + 'static,
    cause: ResetCause,
    alarm: Alarm,
) {
    let mut bench = Bench::new(1);
    bench.access(happen);
    // The watchdog resets within 0.19 s.
    bench.rig.advance_us(250_000).expect("runs");
    bench.settle();
    check_boot(&mut bench, 2, cause);
    let latched = bench.alarm().expect("an alarm is latched");
    assert_eq!((latched.alarm, latched.boot), (alarm, 2));
    let refused = RequestError::Alarm { number: latched.number, alarm };
    assert_eq!(bench.ask(&go(Axis::SensorFine, 50_000)), Err(refused));

    bench.access(|rig| rig.press_reset());
    bench.settle();
    check_boot(&mut bench, 3, ResetCause::Pin);
    assert_eq!(bench.alarm(), Some(latched), "it survives a reset");
    bench.access(|rig| rig.set_power(false));
    bench.rig.advance_us(100_000).expect("runs");
    assert!(!bench.report().powered);
    bench.access(|rig| rig.set_power(true));
    bench.settle();
    check_boot(&mut bench, 4, ResetCause::PowerOn);
    assert_eq!(bench.alarm(), Some(latched), "and a loss of power");

    let wrong = bench.ask(&Request::ClearAlarm { number: latched.number + 1 });
    assert!(matches!(wrong, Err(RequestError::NoSuchAlarm { .. })), "{wrong:?}");
    bench.clear(|latched| *latched == alarm);
    // A reset within the next millisecond would restore the latched alarm, which is the safe side.
    bench.rig.advance_us(10_000).expect("runs");
    bench.access(|rig| rig.press_reset());
    bench.settle();
    check_boot(&mut bench, 5, ResetCause::Pin);
    assert_eq!(bench.alarm(), None, "a cleared alarm stays cleared");
}

#[test]
fn the_watchdog_resets_a_firmware_whose_clock_has_died() {
    // A stray write stops the control loop's timer.
    leaves_an_alarm(|rig| rig.write_register(TIM5_CR1, 0), ResetCause::Watchdog, Alarm::Watchdog);
}

#[test]
fn reports_a_brown_out() {
    leaves_an_alarm(|rig| rig.brown_out(), ResetCause::BrownOut, Alarm::BrownOut);
}

fn astray(code: &'static [u16], alarm: Alarm) {
    let mut bench = Bench::new(1);
    let resets = bench.report().resets;
    let task = bench.variable("__embassy_main");
    let functions: HashSet<u64> =
        symbols(|symbol| symbol.kind() == SymbolKind::Text).into_iter().map(|(at, _)| at & !1).collect();
    let is_function = move |word: u32| word & 1 == 1 && functions.contains(&u64::from(word & !1));
    let replaced = bench.peek(move |rig| rig.redirect_program(task, is_function, code));
    assert!(replaced, "the task's function is found and replaced");
    for _ in 0..100 {
        bench.rig.advance_us(100).expect("runs");
    }
    bench.settle();
    assert_eq!(bench.report().resets, resets + 1);
    check_boot(&mut bench, 2, ResetCause::Software);
    bench.clear(|latched| *latched == alarm);
}

#[test]
fn reports_a_program_fault() {
    // UDF: undefined instruction.
    astray(&[0xde00], Alarm::Panic);
}

#[test]
fn reports_a_stack_overflow_before_it_reaches_variables() {
    // PUSH {R0-R7, LR} in a loop.
    astray(&[0xb5ff, 0xe7fd], Alarm::StackOverflow);
}

#[test]
fn reports_a_stack_overflow_by_a_large_frame() {
    // SUB SP, #508 sixteen times, then STR R0, [SP]: skips 8 KiB at a time.
    const CODE: [u16; 18] = {
        let mut code = [0xb0ff; 18];
        (code[16], code[17]) = (0x9000, 0xe7ed);
        code
    };
    astray(&CODE, Alarm::StackOverflow);
}

#[test]
fn a_board_without_power_hears_nothing() {
    let mut bench = Bench::new(1);
    bench.access(|rig| rig.set_power(false));
    bench.send(&Request::Hello);
    bench.rig.settle().expect("time does not pass for it without end");
    bench.access(|rig| rig.set_power(true));
    bench.rig.settle().expect("runs");
    assert_eq!(bench.answers(), [], "of the request before");
    assert_eq!(bench.say_hello().reset_cause, ResetCause::PowerOn);
}
