//! Resets: each has its cause and the next boot number, nobody acts on requests of an earlier boot, and what was grave
//! enough to reset the board is an alarm that stays until somebody has read and cleared it.

use std::collections::HashSet;

use crate::bench::{Bench, go, request_frame, symbols};
use farnear_protocol::{
    EventKind, Request, RequestError,
    message::{Alarm, Axis, PositionState, ResetCause},
};
use farnear_sim::RigAccess;
use object::{ObjectSymbol, SymbolKind};

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
    assert_eq!(bench.alarm(), None, "nothing went wrong");
}

#[test]
fn the_reset_button_is_told_from_a_request() {
    let mut bench = Bench::new(1);
    bench.home_axis(Axis::SensorCoarse);
    // The motor has come to rest, and the memory knows.
    bench.rig.advance_us(200_000).expect("runs");
    bench.access(|rig| rig.press_reset());
    bench.settle();
    check_boot(&mut bench, 2, ResetCause::Pin);
    assert_eq!(bench.status().coarse.state, PositionState::Unknown);
    assert_eq!(bench.alarm(), None, "it stood still");
}

/// Something resets the board; the alarm that names it survives further resets and is cleared only by its number.
fn leaves_an_alarm(
    happen: impl FnOnce(&mut RigAccess<'_, '_>) + Send + 'static,
    cause: ResetCause,
    alarm: Alarm,
) {
    let mut bench = Bench::new(1);
    bench.access(happen);
    // The watchdog bites within 0.19 s.
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
    // A reset within the next millisecond would find the record as it was: latched, which is the safe side.
    bench.rig.advance_us(10_000).expect("runs");
    bench.access(|rig| rig.press_reset());
    bench.settle();
    check_boot(&mut bench, 5, ResetCause::Pin);
    assert_eq!(bench.alarm(), None, "what was cleared stays so");
}

#[test]
fn the_watchdog_resets_a_firmware_whose_clock_has_died() {
    // A stray write stops the timer that wakes the control loop.
    leaves_an_alarm(|rig| rig.write_register(TIM5_CR1, 0), ResetCause::Watchdog, Alarm::Watchdog);
}

#[test]
fn a_brown_out_is_told() {
    leaves_an_alarm(|rig| rig.brown_out(), ResetCause::BrownOut, Alarm::BrownOut);
}

/// Lets the program's next step be this code, as a stray pointer in the right place would.
fn astray(code: &'static [u16], alarm: Alarm) {
    let mut bench = Bench::new(1);
    let resets = bench.report().resets;
    let task = bench.variable("__embassy_main");
    let functions: HashSet<u64> =
        symbols(|symbol| symbol.kind() == SymbolKind::Text).into_iter().map(|(at, _)| at & !1).collect();
    let is_function = move |word: u32| word & 1 == 1 && functions.contains(&u64::from(word & !1));
    let replaced = bench.peek(move |rig| rig.lead_astray(task, is_function, code));
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
fn a_fault_of_the_program_is_told() {
    // UDF: an instruction that is none.
    astray(&[0xde00], Alarm::Panic);
}

#[test]
fn a_stack_overflow_is_told_and_reaches_no_variable() {
    // PUSH {R0-R7, LR}, again and again.
    astray(&[0xb5ff, 0xe7fd], Alarm::StackOverflow);
}

#[test]
fn a_stack_overflow_by_a_large_frame_is_told() {
    // SUB SP, #508 sixteen times, STR R0, [SP], again and again: 8 KiB at once.
    const CODE: [u16; 18] = {
        let mut code = [0xb0ff; 18];
        (code[16], code[17]) = (0x9000, 0xe7ed);
        code
    };
    astray(&CODE, Alarm::StackOverflow);
}
