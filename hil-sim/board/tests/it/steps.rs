//! STEP pulses on both axes: exact count, timing, and prompt stop.

use crate::bench::{Bench, amount, go};
use farnear_protocol::{
    EventKind, Request, Response,
    message::{Alarm, Axis, Failure, PositionState},
};
use farnear_sim::plant::{Noise, StageName};

/// Stage travel per STEP pulse.
const STEP_NM: f64 = 156.25;
const MOVES: u32 = 1_000;
const RIGS: u32 = 2;
/// One period of STEP at 40 kHz.
const PERIOD_NS: u64 = 25_000;
/// Between segments an interrupt restarts the timer, at worst after the other axis.
const RESTART_NS: u64 = 1_500;

fn random_moves(seed: u64, moves: u32) {
    let mut bench = Bench::near_home(seed);
    bench.home();
    let mut noise = Noise::new(seed, "test of step counts");
    let mut at = 2000.0;
    bench.move_to(Axis::SensorCoarse, farnear_protocol::Nanometres((at * STEP_NM) as i32));
    let start = bench.report().coarse.microsteps as f64 - at;
    for _ in 0..moves {
        let sign = if noise.uniform() < 0.5 { -1.0 } else { 1.0 };
        // Mostly short moves, some long, so that one, two and several segments occur.
        let steps = (1.0 + 30.0 * noise.uniform().powi(3)) as i64 as f64;
        at = (at + sign * steps).max(10.0);
        let end = bench.carry_out(&go(Axis::SensorCoarse, (at * STEP_NM).round() as i32));
        assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
        let report = bench.report();
        assert_eq!(report.coarse.microsteps as f64, start + at, "a move of {steps} steps to {at}");
        // The rotor oscillates about the commanded position; a lost step would be 64.
        assert!(report.coarse.lost_microsteps.abs() < 2.0, "{report:?}");
    }
    // The board's count agrees.
    assert_eq!(bench.status().steps, bench.report().step_edges());
}

#[test]
fn a_thousand_random_moves_lose_no_step() {
    let moves = amount("FARNEAR_MOVES", MOVES);
    let rigs: Vec<_> = (0..RIGS)
        .map(|rig| std::thread::spawn(move || random_moves(u64::from(rig) + 1, moves / RIGS)))
        .collect();
    for rig in rigs {
        rig.join().expect("all counts are exact");
    }
}

/// Moves both axes back and forth at full speed; returns the longest gap between two cruise edges.
fn travels(bench: &mut Bench, edges_wanted: u64) -> u64 {
    bench.home();
    bench.access(|rig| rig.record_steps());
    let before = bench.report().step_edges();
    let mut worst_ns = 0;
    let mut far = true;
    while bench.report().step_edges() - before < edges_wanted {
        let target = if far { 12_900_000 } else { 100_000 };
        far = !far;
        for axis in [Axis::SensorCoarse, Axis::Lens] {
            assert_eq!(bench.ask(&go(axis, target)), Ok(Response::Accepted));
        }
        bench.settle();
        let status = bench.status();
        assert_eq!([status.coarse.state, status.lens.state], [PositionState::Homed; 2], "{status:?}");
        for (axis, edges) in bench.peek(|rig| rig.take_steps()).into_iter().enumerate() {
            let gaps: Vec<u64> = edges.windows(2).map(|pair| pair[1] - pair[0]).collect();
            // Each ramp takes less than a tenth of the way.
            let cruise = &gaps[gaps.len() / 10..gaps.len() - gaps.len() / 10];
            let slowest = cruise.iter().copied().max().unwrap_or(0);
            let fastest = gaps.iter().copied().min().unwrap_or(0);
            // A timer tick is 24 ns.
            assert!(fastest + 24 >= PERIOD_NS, "axis {axis}: two steps {fastest} ns apart");
            worst_ns = worst_ns.max(slowest);
        }
    }
    let report = bench.report();
    for stage in [report.coarse, report.lens] {
        assert!(stage.lost_microsteps.abs() < 2.0, "{report:?}");
    }
    assert_eq!(bench.status().steps, report.step_edges(), "pulses were lost in the count");
    worst_ns
}

#[test]
fn both_axes_at_40_khz_give_every_step_on_time() {
    let mut bench = Bench::near_home(1);
    let edges = amount("FARNEAR_STEPS", 300_000);
    let worst_ns = travels(&mut bench, edges);
    println!("{edges} steps on two axes: at full speed {PERIOD_NS} to {worst_ns} ns apart");
    assert!(worst_ns <= PERIOD_NS + RESTART_NS, "a step came {} ns late", worst_ns - PERIOD_NS);
}

/// Starts a long move on both axes and stops at a random phase of a segment, in the ramp or at full speed.
fn in_mid_move(bench: &mut Bench, turn: u32) -> farnear_sim::Report {
    let far = bench.status().coarse.measured.0 < 6_000_000;
    for (axis, less) in [(Axis::SensorCoarse, 0), (Axis::Lens, 10_000)] {
        let target = if far { 12_000_000 } else { 500_000 } - less;
        assert_eq!(bench.ask(&go(axis, target)), Ok(Response::Accepted));
    }
    bench.rig.advance_us(60_000 + u64::from(turn) * 23_137).expect("runs")
}

/// Stops both axes during moves; returns the longest time to the last STEP edge in microseconds.
fn stops(
    stop: impl Fn(&mut Bench) -> bool,
    release: impl Fn(&mut Bench),
    expected: fn(&Alarm) -> bool,
) -> u64 {
    let mut bench = Bench::near_home(1);
    let mut worst_us = 0;
    for turn in 0..8 {
        bench.home();
        let before = in_mid_move(&mut bench, turn);
        let events = bench.events.len();
        let counts = stop(&mut bench);
        bench.settle();
        let after = bench.report();
        assert!(after.step_edges() > before.step_edges() || !counts, "it was moving");
        worst_us = worst_us.max(after.last_step_ns().saturating_sub(before.now_ns) / 1000);
        let alarms = bench.events[events..].iter().filter(|event| matches!(event.kind, EventKind::Alarm(_)));
        assert_eq!(alarms.count(), 1, "one cause, one alarm: {:?}", &bench.events[events..]);
        let failed = bench.events[events..].iter().filter(|event| {
            matches!(
                event.kind,
                EventKind::Failed { reason: Failure::Alarm { .. } | Failure::DriverFault, .. }
            )
        });
        assert_eq!(failed.count(), 2, "both moves have ended: {:?}", &bench.events[events..]);
        let status = bench.status();
        assert_eq!([status.coarse.state, status.lens.state], [PositionState::Lost; 2]);
        if counts {
            assert_eq!(status.steps, after.step_edges(), "pulses were lost in the count");
        }
        release(&mut bench);
        bench.rig.advance_us(1_000).expect("runs");
        bench.clear(expected);
    }
    worst_us
}

#[test]
fn the_emergency_stop_ends_the_steps_immediately() {
    let worst_us = stops(
        |bench| {
            bench.access(|rig| rig.set_emergency_stop(true));
            false
        },
        |bench| {
            let latched = bench.alarm().expect("latched");
            let refused = bench.ask(&Request::ClearAlarm { number: latched.number });
            assert!(refused.is_err(), "its circuit is open: {refused:?}");
            bench.access(|rig| rig.set_emergency_stop(false));
        },
        |alarm| *alarm == Alarm::EmergencyStop,
    );
    println!("last STEP at most {worst_us} us after the emergency stop");
    assert!(worst_us <= 1_000, "{worst_us} us");
}

#[test]
fn a_halt_ends_the_steps_within_a_millisecond() {
    let worst_us = stops(
        |bench| {
            bench.send(&Request::Halt);
            true
        },
        |_| {},
        |alarm| *alarm == Alarm::Halt,
    );
    println!("last STEP at most {worst_us} us after the host began to send the halt");
    // The current segment lasts 1 ms at most, the frame 0.1 ms, its tick 0.2 ms.
    assert!(worst_us <= 1_300, "{worst_us} us");
}

#[test]
fn a_driver_fault_ends_the_steps_within_a_millisecond() {
    let worst_us = stops(
        |bench| {
            bench.access(|rig| rig.set_driver_fault(StageName::Lens, true));
            true
        },
        |bench| bench.access(|rig| rig.set_driver_fault(StageName::Lens, false)),
        |alarm| *alarm == Alarm::DriverFault { axis: Axis::Lens },
    );
    println!("last STEP at most {worst_us} us after the driver's fault");
    assert!(worst_us <= 1_200, "{worst_us} us");
}

#[test]
fn a_stop_in_mid_move_brakes_along_the_ramp_and_loses_nothing() {
    let mut bench = Bench::near_home(1);
    bench.home();
    let mut worst_us = 0;
    for turn in 0..8 {
        let before = in_mid_move(&mut bench, turn);
        bench.send(&Request::Stop);
        let end = bench.settle();
        assert!(matches!(end, EventKind::Failed { reason: Failure::Stopped, .. }), "{end:?}");
        let after = bench.report();
        assert!(after.step_edges() > before.step_edges(), "it was moving");
        worst_us = worst_us.max((after.last_step_ns() - before.now_ns) / 1000);
        let status = bench.status();
        assert_eq!(status.steps, after.step_edges());
        let states = [status.coarse.state, status.lens.state];
        assert_eq!(states, [PositionState::Homed; 2], "position and encoder still agree");
    }
    println!("last STEP at most {worst_us} us after the request left the host");
    // 6.25 mm/s at 50 mm/s2 takes 125 ms, twice that with rounded corners; request 0.1 ms, step queue a few
    // ms.
    assert!(worst_us <= 250_000 + 10_000, "{worst_us} us");
}
