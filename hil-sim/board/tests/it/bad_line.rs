//! At a bit error rate of 1e-4 each request is answered correctly or fails, and none acts twice.

use crate::bench::{Bench, SILENCE, fine_shot};
use farnear_protocol::{EventKind, Request, Response};
use farnear_sim::{RigConfig, Scenario};

const REQUESTS: u32 = 10_000;
/// Interval of requests that act.
const RUN_EVERY: u32 = 50;

#[test]
fn ten_thousand_requests_over_a_bad_line() {
    let scenario = Scenario { bit_error_rate: 1e-4, ..Scenario::default() };
    let mut bench = Bench::with(&RigConfig { seed: 5, scenario, ..RigConfig::default() });
    let shot = |target| fine_shot(target, 200, 1_000, 200);
    let (mut asked, mut unanswered, mut runs) = (1, 0, 0u32);
    let mut index = 0;
    while asked < REQUESTS {
        asked += 1;
        if asked % RUN_EVERY == 0 {
            // Any position settles immediately; only the trigger counts. Loading has disarmed the board.
            match bench.try_ask(&Request::ArmProgram { shots: 1 }) {
                Some(Ok(Response::Accepted)) => {}
                other => panic!("expected Armed, got {other:?}"),
            }
            match bench.try_ask(&Request::RunProgram { silence: SILENCE }) {
                Some(Ok(Response::Accepted)) => {}
                other => panic!("expected an accepted run, got {other:?}"),
            }
            bench.rig.settle().expect("runs");
            bench.answers();
            runs += 1;
            assert_eq!(bench.report().triggers, runs, "a run gave more or less than one trigger");
            continue;
        }
        // The answers differ per request: the exposure's position, or the board's counters.
        index = (index + 1) % 4;
        let request = if asked % 2 == 0 || runs == 0 {
            Request::LoadShot { index: if runs == 0 { 0 } else { index }, shot: shot(20_000) }
        } else {
            Request::Status
        };
        match (&request, bench.try_ask(&request)) {
            (_, None) => unanswered += 1,
            (Request::LoadShot { .. }, Some(Ok(Response::Accepted))) => {}
            (Request::Status, Some(Ok(Response::Status(status)))) => assert_eq!(status.triggers, runs),
            (_, other) => panic!("{request:?} was answered with {other:?}"),
        }
    }
    let report = bench.report();
    let link = bench.status().link;
    println!(
        "{asked} requests, {runs} of them exposures; {} bits flipped; the board dropped {} frames and answered {} \
         repeats from memory; {unanswered} requests failed",
        report.flipped_bits, link.bad_frames, link.repeated
    );
    assert!(report.flipped_bits > 100 && link.bad_frames > 50 && link.repeated > 20, "the line was too good");
    assert_eq!((report.triggers, report.missed_triggers), (runs, 0));
    assert!(unanswered <= 1, "four attempts of a request are lost together once in a million");
    assert!(!bench.events.iter().any(|event| matches!(event.kind, EventKind::Failed { .. })));
}
