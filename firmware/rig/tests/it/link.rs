//! The link through the public interface: sessions, repeated requests, stored answers.

use crate::bench::{self, AFTER_START_MS, BOOT, Bench, SESSION};
use farnear_protocol::frame::{self, Header, Kind};
use farnear_protocol::message::{Axis, EventKind, Failure, ResetCause, SCHEMA_KEY, SettingKey};
use farnear_protocol::{
    BoardMicros, Nanometres, PROTOCOL_CURRENT, PROTOCOL_MIN, Request, RequestError, Response,
};
use proptest::prelude::*;

fn fine(nm: i32) -> Request {
    bench::go(Axis::SensorFine, nm)
}

#[test]
fn hello_tells_who_it_is() {
    let mut bench = Bench::new(0.0);
    assert!(
        matches!(bench.ask_as(2, 0, &Request::Hello), Ok(Response::Hello(_))),
        "the boot need not be known"
    );
    let hello = bench.hello();
    assert_eq!((hello.protocol_min, hello.protocol_current), (PROTOCOL_MIN, PROTOCOL_CURRENT));
    assert_eq!((hello.schema_key, hello.boot, hello.reset_cause), (SCHEMA_KEY, BOOT, ResetCause::Pin));
    assert_eq!((hello.board.as_str(), hello.firmware.as_str()), ("bench", "0.1.0"));
    assert_eq!((hello.unique_id, hello.emulated), ([3; 12], true));
    assert_eq!(hello.limits.datum, Nanometres(47_000_000));
    assert_eq!((hello.limits.coarse_min, hello.limits.coarse_max), (Nanometres(0), Nanometres(13_000_000)));
    assert_eq!((hello.limits.coarse_step_pm, hello.limits.shots_max), (156_250, 64));
    assert!(hello.limits.fine_max.0 - hello.limits.fine_min.0 >= 156_270, "far to near by the piezo alone");
}

#[test]
fn requests_for_another_boot_or_version_are_refused() {
    let mut bench = Bench::new(0.0);
    for (id, boot, request) in
        [(2, BOOT + 1, fine(20_000)), (3, 0, fine(20_000)), (4, BOOT - 1, Request::Hello)]
    {
        assert_eq!(bench.ask_as(id, boot, &request), Err(RequestError::Boot { current: BOOT }));
    }
    let header = Header { version: PROTOCOL_CURRENT + 1, kind: Kind::Request, id: 9, boot: 0 };
    bench.send_bytes(&frame::encode(header, &[0xFFu8; 32]).expect("it fits"));
    bench.tick();
    let version = RequestError::Version { min: PROTOCOL_MIN, current: PROTOCOL_CURRENT };
    assert_eq!(bench.answers.last(), Some(&(9, Err(version))));
    assert_eq!(bench.status().fine.request, None);
}

#[test]
fn garbage_is_counted_and_malformed_bodies_are_reported() {
    let mut bench = Bench::new(0.0);
    bench.send_bytes(b"\x00hello?\x00\xFF\xFF\x00");
    bench.send_bytes(&[7; 1000]);
    bench.send_bytes(&[0]);
    let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: 5, boot: BOOT };
    bench.send_bytes(&frame::encode(header, &[0xEEu8; 3]).expect("it fits"));
    // An echo of the board's own frames is not a request.
    let echo = Header { kind: Kind::Response, ..header };
    bench.send_bytes(&frame::encode(echo, &Response::Accepted).expect("it fits"));
    bench.tick();
    assert_eq!(bench.answers, [(5, Err(RequestError::Malformed))]);
    let link = bench.status().link;
    assert_eq!((link.frames, link.bad_frames, link.repeated), (3, 4, 0));
}

#[test]
fn a_repeated_request_is_answered_again_and_acts_once() {
    let mut bench = Bench::new(0.0);
    let (id, boot) = (41, BOOT);
    let first = bench.ask_as(id, boot, &fine(20_000));
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::MoveDone { .. }));
    bench.work(&fine(100_000));
    assert_eq!(bench.ask_as(id, boot, &fine(20_000)), first);
    bench.run_ms(30);
    assert_eq!(bench.status().fine.asked, Nanometres(100_000));
    assert_eq!(bench.ask_as(id, boot, &fine(20_001)), Err(RequestError::IdReused));
    assert_eq!(bench.status().link.repeated, 1);
    let done = bench.events.iter().filter(|(_, event)| bench::ends(&event.kind, id)).count();
    assert_eq!(done, 1, "one terminal event");
}

#[test]
fn refusals_are_remembered_too() {
    let mut bench = Bench::new(0.0);
    let running = bench.accepted(&fine(20_000));
    let busy = Err(RequestError::Busy { request: running });
    assert_eq!(bench.ask_as(77, BOOT, &fine(30_000)), busy);
    bench.end_of(running);
    assert_eq!(bench.ask_as(77, BOOT, &fine(30_000)), busy, "the retry of a refused request does not move");
}

#[test]
fn the_last_eight_answers_are_remembered() {
    let mut bench = Bench::new(0.0);
    let answers: Vec<_> = (2..=10).map(|id| (id, bench.ask_as(id, BOOT, &Request::Status))).collect();
    for (id, answer) in &answers[1..] {
        assert_eq!(&bench.ask_as(*id, BOOT, &Request::Status), answer, "the same time, so the same answer");
    }
    let gone = RequestError::IdNotNew { last: 10 };
    assert_eq!(bench.ask_as(2, BOOT, &Request::Status), Err(gone), "the ninth before");
}

#[test]
fn events_are_numbered_and_can_be_read_again() {
    let mut bench = Bench::new(0.0);
    bench.tick();
    assert!(
        matches!(&bench.events[0], (0, event) if event.kind == EventKind::Started { cause: ResetCause::Pin })
    );
    for nm in 0..20 {
        bench.work(&fine(20_000 + nm));
    }
    assert!(bench.events.iter().enumerate().all(|(i, (number, _))| i as u32 == *number), "no gap");
    let (_, gone) = bench.ask(&Request::ReadEvent { number: 4 });
    assert_eq!(gone, Err(RequestError::EventGone { oldest: 5, next: 21 }));
    for (number, event) in bench.events.clone().into_iter().skip(5) {
        assert_eq!(bench.ask(&Request::ReadEvent { number }).1, Ok(Response::Event(event)));
    }
}

#[test]
fn a_host_that_does_not_listen_loses_events_but_no_answers() {
    let mut bench = Bench::new(0.0);
    bench.run_ms(AFTER_START_MS);
    let outstanding = u32::from(bench.hello().outstanding);
    bench.answers.clear();
    bench.deaf = true;
    let first = bench.next_id;
    for id in first..first + 80 {
        bench.send_as(id, BOOT, &fine(20_000 + id as i32));
        bench.run_ms(15);
    }
    bench.deaf = false;
    bench.run_ms(1);
    // The promised number is answered; then as many rejections wait; later ones are counted.
    let full = Err(RequestError::QueueFull { outstanding: outstanding as u8 });
    let ids: Vec<u32> = bench.answers.iter().map(|(id, _)| *id).collect();
    assert_eq!(ids, (first..first + outstanding + 64).collect::<Vec<_>>());
    for (id, answer) in &bench.answers {
        let admitted = *id < first + outstanding;
        assert_eq!(*answer, if admitted { Ok(Response::Accepted) } else { full.clone() }, "{id}");
    }
    let status = bench.status();
    assert_eq!(status.link.overflowed, 80 - outstanding);
    assert_eq!(status.fine.asked, Nanometres(20_000 + (first + outstanding - 1) as i32));
    let next = bench.next_id;
    assert_eq!(bench.ask_as(next, BOOT, &fine(20_005)), Ok(Response::Accepted));
    assert!(matches!(bench.end_of(next), EventKind::MoveDone { .. }));
}

#[test]
fn a_reboot_stops_answers_and_then_resets() {
    let mut bench = Bench::homed();
    let id = bench.accepted(&bench::go(Axis::SensorCoarse, 9_000_000));
    bench.run_ms(400);
    let asked = bench.now;
    let reboot = bench.accepted(&Request::Reboot);
    assert_eq!(bench.ask(&fine(20_000)).1, Err(RequestError::Busy { request: reboot }));
    assert_eq!(bench.ask_as(reboot, BOOT, &Request::Reboot), Ok(Response::Accepted), "a retry");
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::Failed { reason: Failure::Stopped, .. }), "{end:?}");
    assert_eq!(bench.ask(&fine(20_000)).1, Err(RequestError::Busy { request: reboot }));
    let edges = bench.hardware.coarse.edges;
    bench.run_ms(30);
    assert_eq!(bench.hardware.coarse.edges, edges);
    let reset = bench.reset_at.expect("it resets");
    assert!((135_000..180_000).contains(&(reset - asked)), "{} us", reset - asked);
}

#[test]
fn a_reboot_waits_for_the_slowest_ramp() {
    let mut bench = Bench::homed();
    let key = SettingKey::CoarseAccelerationUmPerS2;
    bench.ask(&Request::WriteSetting { key, value: 1_000 }).1.expect("in range");
    let id = bench.accepted(&bench::go(Axis::SensorCoarse, 12_000_000));
    bench.run_ms(2_500);
    bench.accepted(&Request::Reboot);
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::Failed { reason: Failure::Stopped, .. }), "{end:?}");
    assert_eq!(bench.reset_at, None, "it braked for two seconds");
    bench.run_ms(30);
    assert!(bench.reset_at.is_some());
}

#[test]
fn a_reboot_does_not_wait_for_a_dead_host() {
    let mut bench = Bench::new(0.0);
    bench.deaf = true;
    bench.send_as(2, BOOT, &Request::Reboot);
    bench.run_ms(900);
    assert_eq!(bench.reset_at, None);
    bench.run_ms(150);
    assert!(bench.reset_at.is_some());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn bit_errors_never_make_a_request_act_twice(seed in any::<u64>()) {
        // 250 requests, 40 cases: 10,000 requests with one bit in 10,000 turned, both ways.
        let mut random = seed | 1;
        let mut noisy = |bytes: &[u8]| -> Vec<u8> {
            let turn = |byte: &u8| (0..8).fold(*byte, |byte, bit| {
                random ^= random << 13;
                random ^= random >> 7;
                random ^= random << 17;
                if random % 10_000 == 0 { byte ^ (1 << bit) } else { byte }
            });
            bytes.iter().map(turn).collect()
        };
        let mut bench = Bench::new(700.0);
        bench.work(&fine(20_000));
        bench.tick();
        bench.deaf = true;
        let mut decoder = frame::Decoder::new();
        let first_event = bench.events.last().map_or(0, |(number, _)| number + 1);
        for next_event in first_event..first_event + 250 {
            let id = bench.next_id;
            bench.next_id += 1;
            let request = fine(20_000 + (id % 7) as i32);
            let bytes = bench::request_frame(id, BOOT, SESSION, &request);
            let mut answered = false;
            for _try in 0..6 {
                bench.send_bytes(&noisy(&bytes));
                bench.send_bytes(&[0]); // flushes what a turned delimiter left open
                bench.tick();
                while let Some(reply) = bench.rig.transmit() {
                    for byte in noisy(&reply) {
                        if let Some(Ok(packet)) = decoder.push(byte) {
                            answered |= packet.header.kind == Kind::Response && packet.header.id == id;
                        }
                    }
                }
                decoder.push(0);
                if answered {
                    break;
                }
            }
            prop_assert!(answered, "request {}", id);
            bench.run_ms(15);
            // Exactly one terminal event, of this request, though many frames arrived twice.
            bench.deaf = false;
            bench.collect();
            bench.deaf = true;
            let read = match bench.rig_event(next_event) {
                Some(event) => event,
                None => return Err(TestCaseError::fail(std::format!("no event {next_event}"))),
            };
            prop_assert!(bench::ends(&read, id), "{:?} is not the end of {}", read, id);
            prop_assert!(bench.rig_event(next_event + 1).is_none(), "one end only");
        }
    }
}

#[test]
fn a_million_random_byte_strings_do_nothing() {
    let mut bench = Bench::new(700.0);
    let mut random = 88_172_645_463_325_252u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        random
    };
    for _ in 0..1_000_000 {
        for _ in 0..next() % 24 {
            bench.rig.receive(next() as u8);
            while bench.rig.serve(BoardMicros(0)) {}
        }
        bench.rig.receive(0);
        while bench.rig.serve(BoardMicros(0)) {}
    }
    bench.run_ms(20);
    assert!(bench.answers.is_empty(), "nobody guesses a CRC-32 in a million tries: {:?}", bench.answers);
    let status = bench.status();
    assert!(status.link.bad_frames > 900_000 && status.link.frames == 2);
    assert_eq!((bench.hardware.coarse.edges, bench.hardware.dac), (0, 0));
}
