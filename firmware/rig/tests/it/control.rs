//! The control loop against a fake board: order of its actions, waiting, and single reports.

mod fake;

use std::panic::{AssertUnwindSafe, catch_unwind};

use farnear_protocol::frame::{Decoder, Kind, Packet};
use farnear_protocol::message::{
    Alarm, Axis, EventKind, LINK_TRIAL, LinkRate, PositionState, RequestError, ResetCause,
};
use farnear_protocol::{BoardMicros, Event, Log, Request};
use farnear_rig::Rig;
use farnear_rig::control::{Control, LAST_FRAME, Note, QUIET_TICKS};
use farnear_rig::io::{REST_TICKS, TICK_US};
use farnear_rig::settings::Settings;

use self::fake::{Call, Fake};
use crate::bench::{self, BOOT};

/// All calls of a tick with an event and a line of the log to send.
const TICK: [Call; 13] = [
    Call::SampleGauge,
    Call::Receive,
    Call::Gauge,
    Call::Now,
    Call::Coarse,
    Call::Lens,
    Call::EmergencyStop,
    Call::SupplyLow,
    Call::Exposure,
    Call::Strobe,
    Call::Apply,
    Call::Send,
    Call::FeedWatchdog,
];

fn rig() -> Rig {
    let parts = Settings { memory: false, ..Settings::DEFAULT };
    Rig::with_parts(bench::identity(BOOT, ResetCause::Pin), parts, None, BoardMicros(0))
}

fn log() -> Log {
    Log { bytes: b"a line".as_slice().try_into().expect("it fits") }
}

fn packets(fake: &Fake) -> Vec<Packet> {
    let mut decoder = Decoder::new();
    let bytes = fake.sent.iter().flatten();
    bytes.filter_map(|byte| Some(decoder.push(*byte)?.expect("whole frames"))).collect()
}

fn events(fake: &Fake) -> Vec<EventKind> {
    let packets = packets(fake);
    let events = packets.iter().filter(|packet| packet.header.kind == Kind::Event);
    events.map(|packet| packet.message::<Event>().expect("an event").kind).collect()
}

fn run(control: &mut Control<'_>, fake: &mut Fake, ticks: usize) {
    for _ in 0..ticks {
        tick(control, fake);
    }
}

/// Returns the time until the next tick, in ticks.
fn tick(control: &mut Control<'_>, fake: &mut Fake) -> u32 {
    let due = control.tick(fake);
    (0..due).for_each(|_| fake.pass());
    due
}

#[test]
fn a_tick_goes_in_this_order() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    fake.logs.push_back(log());
    Control::new(&mut rig).tick(&mut fake);
    assert_eq!(fake.calls, TICK);
}

#[test]
fn a_stage_is_homed_by_way_of_the_loop_and_each_tick_feeds_the_watchdog() {
    let (mut rig, mut fake) = (rig(), Fake::new(4_000.0));
    fake.ask(&bench::home(Axis::SensorCoarse));
    let mut control = Control::new(&mut rig);
    let mut ticks = 0;
    while !matches!(events(&fake).last(), Some(EventKind::Homed { axis: Axis::SensorCoarse, .. })) {
        run(&mut control, &mut fake, 1_000);
        ticks += 1_000;
        assert!(ticks < 50_000, "it is not homed after ten seconds: {:?}", events(&fake));
    }
    assert!(ticks > 5_000 && fake.hardware.position_um().abs() <= 0.5, "{}", fake.hardware.position_um());
    assert_eq!((fake.fed, fake.resets), (ticks, 0));
    let homed = Note::Position { axis: Axis::SensorCoarse, state: PositionState::Homed };
    assert_eq!(fake.notes, [Note::Session { request: 1 }, homed]);
}

#[test]
fn a_hanging_tick_does_not_feed_the_watchdog() {
    for (place, call) in TICK.iter().enumerate().filter(|(_, call)| **call != Call::FeedWatchdog) {
        let (mut rig, mut fake) = (rig(), Fake::new(800.0));
        fake.logs.push_back(log());
        fake.hangs_after = Some(place);
        let tick = catch_unwind(AssertUnwindSafe(|| Control::new(&mut rig).tick(&mut fake)));
        assert!(tick.is_err() && fake.fed == 0, "{call:?}");
    }
}

/// The circuit cuts the pulses: read too early, it would look closed when the timer already shows a stop.
#[test]
fn an_emergency_stop_between_two_readings_is_not_a_late_step() {
    for moment in [Call::Receive, Call::Gauge, Call::Coarse, Call::Lens, Call::EmergencyStop, Call::Apply] {
        // 20 ticks are two of the longest segments.
        for ticks in 2_000..2_020 {
            let (mut rig, mut fake) = (rig(), Fake::new(5_000.0));
            fake.ask(&bench::home(Axis::SensorCoarse));
            let mut control = Control::new(&mut rig);
            run(&mut control, &mut fake, ticks);
            let before = fake.hardware.position_um();
            assert!(before < 4_990.0, "it moves");
            fake.opens_before = Some(moment);
            run(&mut control, &mut fake, 100);
            let alarms: Vec<Alarm> = events(&fake)
                .iter()
                .filter_map(|kind| match kind {
                    EventKind::Alarm(record) => Some(record.alarm),
                    _ => None,
                })
                .collect();
            assert_eq!(alarms, [Alarm::EmergencyStop], "{moment:?} in tick {ticks}");
        }
    }
}

#[test]
fn an_idle_rig_is_polled_rarely_until_a_request_or_motion() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    fake.ask(&Request::Status);
    let awake = |control: &mut Control<'_>, fake: &mut Fake| {
        let woken = fake.now;
        while tick(control, fake) == 1 {
            assert!(fake.now - woken < 10_000_000, "it never rests");
        }
        fake.now - woken
    };
    let quiet = u64::from(QUIET_TICKS * TICK_US);
    assert!(awake(&mut control, &mut fake) >= quiet);
    run(&mut control, &mut fake, 9);
    assert!((0..100).all(|_| tick(&mut control, &mut fake) == REST_TICKS));
    // Noise is not a request, but its sender may be about to send one.
    fake.hear(&[1, 0]);
    assert!(awake(&mut control, &mut fake) >= quiet);
    // A request is answered without another rest.
    let (asked, sent) = (fake.now, fake.sent.len());
    fake.ask(&Request::Status);
    while fake.sent.len() == sent {
        assert_eq!(tick(&mut control, &mut fake), 1);
    }
    assert!(fake.now - asked < 2_000, "{} us", fake.now - asked);
    awake(&mut control, &mut fake);
    // A motion, and a while after it.
    fake.ask(&bench::home(Axis::SensorCoarse));
    let homing = awake(&mut control, &mut fake);
    assert!(matches!(events(&fake).last(), Some(EventKind::Homed { axis: Axis::SensorCoarse, .. })));
    assert!(homing > 100_000, "{homing} us");
    // An emergency stop is reported one rest period later at most; the motors were at rest.
    let (pressed, heard) = (fake.now, events(&fake).len());
    fake.hardware.open_circuit();
    while events(&fake).len() == heard {
        tick(&mut control, &mut fake);
    }
    let rest = u64::from((REST_TICKS + 2) * TICK_US);
    assert!(fake.now - pressed <= rest, "{} us", fake.now - pressed);
    // A sinking supply is polled continuously.
    assert!(awake(&mut control, &mut fake) >= quiet);
    fake.hardware.faults.supply_low = true;
    tick(&mut control, &mut fake);
    assert!((0..1_000).all(|_| tick(&mut control, &mut fake) == 1));
}

#[test]
fn a_dry_step_queue_is_reported_once() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    for (dry, ticks) in [(false, 3), (true, 5), (false, 2), (true, 2)] {
        fake.dry = dry;
        run(&mut control, &mut fake, ticks);
    }
    let time = |tick: u64| BoardMicros(tick * u64::from(TICK_US));
    assert_eq!(fake.notes, [Note::StepQueueDry { time: time(3) }, Note::StepQueueDry { time: time(10) }]);
}

#[test]
fn the_log_takes_the_room_that_is_left() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    fake.logs.push_back(log());
    fake.room = 0;
    run(&mut control, &mut fake, 3);
    assert!(fake.sent.is_empty() && fake.logs.len() == 1, "no room");
    fake.room = 1;
    run(&mut control, &mut fake, 1);
    assert_eq!((fake.sent.len(), fake.logs.len()), (1, 1), "the event goes first");
    run(&mut control, &mut fake, 3);
    assert_eq!((fake.sent.len(), fake.logs.len()), (1, 1), "the log waits for a session");
    fake.ask(&Request::Status);
    run(&mut control, &mut fake, 10);
    let kinds: Vec<Kind> = packets(&fake).iter().map(|packet| packet.header.kind).collect();
    assert_eq!(kinds, [Kind::Event, Kind::Response, Kind::Response, Kind::Log]);
    let packet = packets(&fake).pop().expect("the log");
    assert_eq!((packet.header.id, packet.header.boot, packet.message()), (0, BOOT, Some(log())));
}

#[test]
fn a_host_that_asks_without_a_pause_gets_the_log_too() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    fake.logs.push_back(log());
    // An answer is sent every third tick, and eight of them go before the log.
    for _ in 0..40 {
        fake.room = 1;
        fake.ask(&Request::Status);
        run(&mut control, &mut fake, 1);
    }
    assert!(packets(&fake).iter().any(|packet| packet.header.kind == Kind::Log));
}

/// Reboots a board whose last frame takes this long; returns the microseconds from order to reset.
fn reset_after(ticks_until_sent: usize) -> u64 {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    fake.ask(&Request::Reboot);
    while !fake.notes.contains(&Note::Reset) {
        fake.sending = ticks_until_sent;
        run(&mut control, &mut fake, 1);
        assert!(fake.now < 100_000, "it was not asked to reset");
    }
    let (asked, fed) = (fake.now - u64::from(TICK_US), fake.fed);
    fake.calls.clear();
    while fake.resets == 0 {
        run(&mut control, &mut fake, 1);
        assert!(fake.now < asked + 100_000, "it is not reset");
    }
    let idle = |call: &Call| matches!(call, Call::Now | Call::Reset);
    assert!(fake.calls.iter().all(idle) && fake.fed == fed, "nothing else is done: {:?}", fake.calls);
    fake.reset_at - asked
}

#[test]
fn a_reset_waits_for_the_last_frame() {
    for ticks in [1, 2, 7] {
        assert_eq!(reset_after(ticks), ticks as u64 * u64::from(TICK_US));
    }
}

#[test]
fn a_reset_does_not_wait_for_ever() {
    assert_eq!(reset_after(usize::MAX), u64::from(LAST_FRAME.0));
}

/// The last frame takes three ticks on the wire.
fn asked_for_the_slow_rate(control: &mut Control<'_>, fake: &mut Fake) -> u64 {
    fake.ask(&Request::SetLinkRate { rate: LinkRate::Baud921600 });
    while fake.rates.is_empty() {
        let sent = fake.sent.len();
        run(control, fake, 1);
        if fake.sent.len() > sent {
            fake.sending = 3;
        }
        assert!(fake.now < 20_000, "the rate does not change");
    }
    let answers = packets(fake).iter().filter(|packet| packet.header.kind == Kind::Response).count();
    assert_eq!((answers, fake.sending), (2, 0), "the answers have left at the old rate");
    let (at, rate) = fake.rates[0];
    assert_eq!(rate, LinkRate::Baud921600);
    at
}

#[test]
fn a_link_rate_stays_where_the_host_is_heard_at_it() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    asked_for_the_slow_rate(&mut control, &mut fake);
    fake.ask(&Request::Status);
    run(&mut control, &mut fake, 5_000);
    assert_eq!(fake.rates.len(), 1);
    assert!(fake.notes.contains(&Note::LinkRate(LinkRate::Baud921600)));
}

#[test]
fn a_link_rate_without_requests_is_abandoned() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    let at = asked_for_the_slow_rate(&mut control, &mut fake);
    fake.hear(&[1, 2, 3, 0]); // noise is not a host
    run(&mut control, &mut fake, 5_000);
    assert_eq!(fake.rates[1..], [(at + u64::from(LINK_TRIAL.0), LinkRate::START)]);
}

#[test]
fn a_link_rate_does_not_change_under_work() {
    let (mut rig, mut fake) = (rig(), Fake::new(4_000.0));
    let mut control = Control::new(&mut rig);
    fake.ask(&bench::home(Axis::SensorCoarse));
    fake.ask(&Request::SetLinkRate { rate: LinkRate::Baud921600 });
    run(&mut control, &mut fake, 100);
    assert_eq!(fake.rates, []);
    let refused = Note::Refused { request: 3, error: RequestError::Busy { request: 2 } };
    assert!(fake.notes.contains(&refused), "{:?}", fake.notes);
}

#[test]
fn each_frame_has_a_delimiter_before_it_too() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    for _ in 0..3 {
        fake.ask(&Request::Status);
        run(&mut control, &mut fake, 10);
    }
    assert!(fake.sent.len() > 3);
    for bytes in &fake.sent {
        assert!(bytes.starts_with(&[0]) && bytes.ends_with(&[0]), "{bytes:02x?}");
    }
    // One flipped delimiter costs one frame.
    let frames = packets(&fake).len();
    let bytes: Vec<u8> = fake.sent.concat();
    for place in 0..bytes.len() {
        if bytes[place] == 0 {
            let mut spoilt = bytes.clone();
            spoilt[place] = 0x10;
            let mut decoder = Decoder::new();
            let read = spoilt.iter().filter(|byte| matches!(decoder.push(**byte), Some(Ok(_)))).count();
            assert!(read + 1 >= frames, "{read} of {frames}");
        }
    }
}

#[test]
fn alarms_and_their_end_are_in_the_log() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    fake.ask(&Request::Halt);
    run(&mut control, &mut fake, 10);
    fake.ask(&Request::ClearAlarm { number: 1 });
    run(&mut control, &mut fake, 10);
    let halted = |note: &Note| matches!(note, Note::Alarm(record) if record.alarm == Alarm::Halt);
    assert!(fake.notes.iter().any(halted) && fake.notes.contains(&Note::AlarmCleared { number: 1 }));
}

#[test]
fn a_stop_acts_in_the_tick_that_brings_it_and_other_requests_wait() {
    let (mut rig, mut fake) = (rig(), Fake::new(800.0));
    let mut control = Control::new(&mut rig);
    fake.ask(&Request::Status);
    run(&mut control, &mut fake, 10);
    fake.ask(&Request::Halt);
    tick(&mut control, &mut fake);
    let halted = |note: &Note| matches!(note, Note::Alarm(record) if record.alarm == Alarm::Halt);
    assert!(fake.notes.iter().any(halted));
    run(&mut control, &mut fake, 10);
    let cleared = Note::AlarmCleared { number: 1 };
    fake.ask(&Request::ClearAlarm { number: 1 });
    tick(&mut control, &mut fake);
    tick(&mut control, &mut fake);
    assert!(!fake.notes.contains(&cleared), "a tick takes its notes before it serves others");
    run(&mut control, &mut fake, 10);
    assert!(fake.notes.contains(&cleared));
}
