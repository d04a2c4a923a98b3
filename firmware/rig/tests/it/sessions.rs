//! Sessions: which requests count, the work of a host that left, and no replayed actions.

use crate::bench::{self, Answer, BOOT, Bench, SESSION, request_frame};
use farnear_protocol::frame::{self, Header, Kind};
use farnear_protocol::message::{Alarm, Axis, EventKind, Failure, ID_STEP_MAX, NO_SESSION};
use farnear_protocol::{Call, Micros, Nanometres, Request, RequestError, Response};

const OTHER: u32 = 0x00c0_ffee;

fn fine(nm: i32) -> Request {
    bench::go(Axis::SensorFine, nm)
}

/// Within a tick; `None` without one.
fn answer_to(bench: &mut Bench, bytes: &[u8]) -> Option<Answer> {
    bench.answers.clear();
    bench.send_bytes(bytes);
    bench.tick();
    bench.answers.pop().map(|(_, answer)| answer)
}

fn ask_in(bench: &mut Bench, session: u32, id: u32, request: &Request) -> Answer {
    let boot = if *request == Request::Hello { 0 } else { BOOT };
    answer_to(bench, &request_frame(id, boot, session, request)).expect("an answer")
}

#[test]
fn the_version_before_is_refused_with_both_versions_named() {
    let mut bench = Bench::new(0.0);
    // Hello of version 2: the body is the request alone.
    let header = Header { version: 2, kind: Kind::Request, id: 7, boot: 0 };
    let bytes = frame::encode(header, &Request::Hello).expect("it fits");
    let answer = answer_to(&mut bench, &bytes);
    assert_eq!(answer, Some(Err(RequestError::Version { min: 3, current: 3 })));
}

#[test]
fn nothing_is_done_without_a_session_except_to_say_hello() {
    let mut bench = Bench::new(0.0);
    for request in [fine(20_000), Request::Status, Request::Stop] {
        assert_eq!(ask_in(&mut bench, NO_SESSION, 50, &request), Err(RequestError::NotInSession));
        assert_eq!(ask_in(&mut bench, OTHER, 51, &request), Err(RequestError::NotInSession));
    }
    assert_eq!(ask_in(&mut bench, NO_SESSION, 52, &Request::OpenSession), Err(RequestError::NotInSession));
    let hello = ask_in(&mut bench, NO_SESSION, 3, &Request::Hello);
    assert!(matches!(&hello, Ok(Response::Hello(hello)) if hello.last_id == 1), "{hello:?}");
    let status = bench.status();
    assert_eq!((status.link.stale, status.fine.request), (7, None));
}

#[test]
fn opening_a_session_ends_what_the_one_before_had_begun() {
    let mut bench = Bench::homed();
    let old = bench.accepted(&bench::go(Axis::SensorCoarse, 9_000_000));
    bench.run_ms(400);
    let first = bench.next_id;
    assert_eq!(ask_in(&mut bench, OTHER, first, &Request::OpenSession), Ok(Response::Accepted));
    let end = bench.end_of(old);
    assert!(matches!(end, EventKind::Failed { reason: Failure::Stopped, .. }), "{end:?}");
    assert_eq!(ask_in(&mut bench, SESSION, first + 1, &Request::Status), Err(RequestError::NotInSession));
    bench.run_ms(300);
    let edges = bench.hardware.coarse.edges;
    bench.run_ms(30);
    assert_eq!(bench.hardware.coarse.edges, edges, "it stands");
    // The position is still known, and the new host may move immediately.
    let id = first + 2;
    let moved = ask_in(&mut bench, OTHER, id, &bench::go(Axis::SensorCoarse, 1_000_000));
    assert_eq!(moved, Ok(Response::Accepted));
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::MoveDone { asked: Nanometres(1_000_000), .. }), "{end:?}");
}

#[test]
fn another_hosts_frames_do_not_keep_abandoned_work_alive() {
    let mut bench = Bench::homed();
    let silence = Micros(200_000);
    let id =
        bench.accepted(&Request::Move { axis: Axis::SensorCoarse, target: Nanometres(9_000_000), silence });
    for _ in 0..30 {
        bench.run_ms(10);
        // A second program, and a replay of the first host's requests.
        let _ = ask_in(&mut bench, OTHER, 4_000, &Request::Status);
        let _ = ask_in(&mut bench, NO_SESSION, 4_001, &Request::Hello);
        let _ = ask_in(&mut bench, SESSION, 1, &Request::Status);
    }
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::Failed { reason: Failure::Alarm { .. }, .. }), "{end:?}");
    assert!(matches!(bench.alarm(), Some(Alarm::HostSilence { request }) if request == id));
}

#[test]
fn no_old_frame_acts_again_however_much_came_since() {
    let mut bench = Bench::new(0.0);
    let first = bench.next_id;
    let recorded = [
        request_frame(1, BOOT, SESSION, &Request::OpenSession),
        request_frame(first, BOOT, SESSION, &fine(20_000)),
        request_frame(first + 1, BOOT, SESSION, &Request::Halt),
        request_frame(first + 2, 0, NO_SESSION, &Request::Hello),
    ];
    assert_eq!(answer_to(&mut bench, &recorded[1]), Some(Ok(Response::Accepted)));
    bench.end_of(first);
    assert_eq!(answer_to(&mut bench, &recorded[2]), Some(Ok(Response::Accepted)));
    bench.next_id = first + 2;
    bench.clear();
    bench.work(&fine(100_000));
    let replay = |bench: &mut Bench, error: &RequestError| {
        for frame in &recorded {
            let answer = answer_to(bench, frame).expect("an answer");
            assert!(matches!(&answer, Ok(Response::Hello(_))) || answer.as_ref() == Err(error), "{answer:?}");
        }
        bench.run_ms(20);
        let status = bench.status();
        assert_eq!((status.fine.asked, status.alarm), (Nanometres(100_000), None));
    };
    for _ in 0..1_000 {
        bench.status();
    }
    let last = bench.next_id - 1;
    replay(&mut bench, &RequestError::IdNotNew { last });
    // Another host's session, and then the first host's number again.
    for session in [OTHER, SESSION] {
        let id = bench.next_id;
        assert_eq!(ask_in(&mut bench, session, id, &Request::OpenSession), Ok(Response::Accepted));
        bench.next_id = id + 1;
        for frame in &recorded[1..3] {
            let answer = answer_to(&mut bench, frame);
            let named =
                matches!(answer, Some(Err(RequestError::NotInSession | RequestError::IdNotNew { .. })));
            assert!(named, "{answer:?}");
        }
        let opened = answer_to(&mut bench, &recorded[0]);
        assert_eq!(opened, Some(Err(RequestError::IdNotNew { last: id })), "a replayed frame opens nothing");
    }
    bench.run_ms(20);
    assert_eq!(bench.status().fine.asked, Nanometres(100_000));
}

#[test]
fn a_late_request_counts_if_it_never_came_and_only_then() {
    let mut bench = Bench::new(0.0);
    let first = bench.next_id;
    assert_eq!(ask_in(&mut bench, SESSION, first + 5, &Request::Stop), Ok(Response::Accepted));
    assert_eq!(ask_in(&mut bench, SESSION, first + 2, &fine(20_000)), Ok(Response::Accepted), "overtaken");
    bench.end_of(first + 2);
    for id in first + 6..first + 20 {
        ask_in(&mut bench, SESSION, id, &Request::Stop).expect("a stop");
    }
    let gone = Err(RequestError::IdNotNew { last: first + 19 });
    assert_eq!(ask_in(&mut bench, SESSION, first + 2, &fine(20_000)), gone);
    let far = first + 20 + ID_STEP_MAX;
    assert_eq!(ask_in(&mut bench, SESSION, far, &fine(20_000)), gone, "nobody uses all ids up");
}

#[test]
fn a_frame_of_exactly_256_bytes_is_read() {
    let mut bench = Bench::new(0.0);
    let body = [[0x11u8; 16]; frame::BODY_MAX / 16];
    let header = Header { version: 3, kind: Kind::Request, id: 9, boot: BOOT };
    let bytes = frame::encode(header, &body).expect("the largest body");
    assert_eq!(bytes.len(), frame::FRAME_MAX);
    assert_eq!(answer_to(&mut bench, &bytes), Some(Err(RequestError::Malformed)), "it was read");
}

#[test]
fn a_session_survives_a_hello_in_its_midst() {
    let mut bench = Bench::new(0.0);
    let id = bench.accepted(&fine(20_000));
    let hello = bench.hello();
    assert!(hello.last_id >= id && hello.emulated);
    assert!(matches!(bench.end_of(id), EventKind::MoveDone { .. }));
    let call = Call { session: SESSION, request: Request::Status };
    let header = Header { version: 3, kind: Kind::Request, id: bench.next_id, boot: BOOT };
    assert!(answer_to(&mut bench, &frame::encode(header, &call).expect("fits")).is_some_and(|a| a.is_ok()));
}
