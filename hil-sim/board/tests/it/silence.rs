//! Host silence during motion: the board sends a keep-alive, then stops.

use crate::bench::{Bench, SILENCE};
use farnear_protocol::{
    EventKind, Micros, Nanometres, Request, Response,
    message::{Alarm, Axis, Failure, PositionState},
};

const DEADLINE: Micros = Micros(400_000);
/// Time limit of an answer.
const ANSWER_US: u64 = 2_000;

fn move_off(bench: &mut Bench, silence: Micros) -> u32 {
    bench.home_axis(Axis::SensorCoarse);
    let move_off = Request::Move { axis: Axis::SensorCoarse, target: Nanometres(12_000_000), silence };
    let id = bench.send(&move_off);
    bench.rig.advance_us(ANSWER_US).expect("runs");
    assert_eq!(bench.answers(), [(id, Ok(Response::Accepted))]);
    id
}

#[test]
fn a_silent_host_stops_the_move_within_its_deadline() {
    let mut bench = Bench::near_home(1);
    let begin_ns = bench.report().now_ns;
    let request = move_off(&mut bench, DEADLINE);
    let begin_ns = begin_ns.max(bench.report().now_ns - 1_000 * ANSWER_US);
    let end = bench.settle();
    assert!(matches!(end, EventKind::Failed { reason: Failure::Alarm { .. }, .. }), "{end:?}");
    let asked = bench.events.iter().filter(|event| event.kind == EventKind::StillThere { request });
    assert_eq!(asked.count(), 1, "it asks once");
    let stopped_us = (bench.report().last_step_ns() - begin_ns) / 1000;
    println!(
        "the last STEP came {stopped_us} us after the host's last frame; allowed were {} us",
        DEADLINE.0
    );
    // The current segment ends within a millisecond.
    assert!(stopped_us <= u64::from(DEADLINE.0) + 1_300, "{stopped_us} us");
    assert_eq!(bench.status().coarse.state, PositionState::Lost);
    bench.clear(|alarm| *alarm == Alarm::HostSilence { request });
}

#[test]
fn any_frame_keeps_the_move_alive() {
    let mut bench = Bench::near_home(1);
    move_off(&mut bench, DEADLINE);
    for _ in 0..8 {
        bench.rig.advance_us(300_000).expect("runs");
        bench.status();
    }
    let end = bench.settle();
    assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
    assert!(bench.events.iter().any(|event| matches!(event.kind, EventKind::StillThere { .. })), "it asked");
}

#[test]
fn deadlines_outside_the_limits_are_refused() {
    let mut bench = Bench::new(1);
    for silence in [Micros(0), Micros(99_999), Micros(SILENCE.0 + 1)] {
        let refused = bench.ask(&Request::Home { axis: Axis::Lens, silence });
        assert!(matches!(refused, Err(farnear_protocol::RequestError::Silence { .. })), "{refused:?}");
    }
}
