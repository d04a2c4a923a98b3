//! The fine axis and the exposure program through the public interface.

use crate::bench::{self, AFTER_START_MS, Bench, SILENCE};
use farnear_protocol::message::{
    Axis, EventKind, Failure, PositionState, ProgramState, SettingKey, Shot, ShotFault, ShotRecord,
    TriggerMode,
};
use farnear_protocol::{Micros, Nanometres, Request, RequestError};

const RUN: Request = Request::RunProgram { silence: SILENCE };
const FAR: i32 = 20_000;
const NEAR: i32 = 176_270;

fn fine(nm: i32) -> Request {
    bench::go(Axis::SensorFine, nm)
}

fn shot(nm: i32) -> Shot {
    Shot {
        axis: Axis::SensorFine,
        target: Nanometres(nm),
        exposure: Micros(5_000),
        settle_window: Nanometres(50),
        settle_dwell: Micros(2_000),
        repeat: 1,
        mode: TriggerMode::Hardware,
    }
}

fn load(bench: &mut Bench, shots: &[Shot]) {
    for (index, shot) in shots.iter().enumerate() {
        bench.accepted(&Request::LoadShot { index: index as u8, shot: *shot });
    }
}

fn run(bench: &mut Bench, shots: u8) -> (Vec<ShotRecord>, EventKind) {
    bench.events.clear();
    bench.accepted(&Request::ArmProgram { shots });
    let end = bench.work(&RUN);
    let taken = bench.events.iter().filter_map(|(_, event)| match &event.kind {
        EventKind::ShotDone { shot, .. } => Some(*shot),
        _ => None,
    });
    (taken.collect(), end)
}

#[test]
fn a_move_right_after_a_reset_waits_for_the_piezo_to_be_lowered_and_settles() {
    let mut bench = Bench::new(700.0);
    let end = bench.work(&fine(FAR.max(NEAR)));
    assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
    let code = bench.hardware.dac;
    bench.reset(Some(code));
    let start = bench.now;
    let end = bench.work(&fine(FAR.max(NEAR)));
    assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
    let ms = (bench.now - start) / 1_000;
    // A ramp of 0.1 s and the swing after it.
    assert!((300..400).contains(&ms), "{ms} ms");
}

#[test]
fn the_piezo_moves_without_homing_and_settles_in_15_ms() {
    let mut bench = Bench::new(700.0);
    bench.run_ms(AFTER_START_MS);
    for target in [FAR, NEAR, FAR, NEAR] {
        let start = bench.now;
        let end = bench.work(&fine(target));
        let EventKind::MoveDone { measured, .. } = end else { panic!("{end:?}") };
        assert!((measured.0 - target).abs() <= 50);
        assert!((bench.hardware.piezo_nm - f64::from(target)).abs() <= 50.0);
        assert!(bench.now - start <= 15_000, "{} us with its dwell", bench.now - start);
    }
    assert_eq!(bench.hardware.coarse.edges, 0);
    assert_eq!(bench.status().coarse.state, PositionState::Unknown);
}

#[test]
fn with_a_second_mode_the_piezo_stays_in_its_window_for_10_ms_before_it_has_settled() {
    let mut bench = Bench::new(700.0);
    for (second_mode, us) in [(0, 2_000..4_000), (1, 10_000..20_000)] {
        let key = SettingKey::PiezoSecondMode;
        bench.ask(&Request::WriteSetting { key, value: second_mode }).1.expect("in range");
        bench.work(&fine(FAR));
        bench.run_ms(100);
        let start = bench.now;
        // It is there.
        bench.work(&fine(FAR));
        assert!(us.contains(&(bench.now - start)), "{second_mode}: {} us", bench.now - start);
    }
}

#[test]
fn a_pair_takes_at_most_60_ms_plus_its_exposures() {
    let mut bench = Bench::homed();
    load(&mut bench, &[shot(FAR), shot(NEAR)]);
    for round in 0..5 {
        let start = bench.now;
        let (taken, end) = run(&mut bench, 2);
        let us = bench.now - start;
        assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
        assert!(us <= 60_000 + 10_000, "{us} us with two exposures of 5 ms");
        assert_eq!(taken.len(), 2);
        for (record, (index, target)) in taken.iter().zip([(0, FAR), (1, NEAR)]) {
            assert_eq!((record.index, record.asked), (index, Nanometres(target)));
            assert_eq!(record.trigger_number, round * 2 + u32::from(index));
            assert!((record.fine.0 - target).abs() <= 50, "{record:?}");
            assert!(record.settle <= Micros(15_000), "{record:?}");
            assert_eq!(record.strobe_end.0 - record.strobe_start.0, 5_000);
            let truth = bench.hardware.piezo_at_trigger[record.trigger_number as usize];
            assert!((truth - f64::from(target)).abs() <= 50.0, "{truth}");
        }
    }
}

#[test]
fn the_camera_is_given_its_read_out_time() {
    let mut bench = Bench::new(700.0);
    load(&mut bench, &[Shot { repeat: 5, exposure: Micros(300), ..shot(FAR) }, shot(FAR + 100)]);
    let (taken, end) = run(&mut bench, 2);
    assert!(matches!(end, EventKind::ProgramDone { exposures: 6, .. }), "{end:?}");
    assert_eq!(taken.iter().map(|record| record.repeat).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 0]);
    for pair in taken.windows(2) {
        let pause = pair[1].trigger.0 - pair[0].strobe_end.0;
        assert!((10_500..11_000).contains(&pause), "{pause} us: as early as allowed, not earlier");
    }
    // Also over the end of a program, and over a stop in the middle of an exposure.
    let id = bench.accepted(&RUN);
    while bench.hardware.triggers.len() < 7 {
        bench.tick();
    }
    bench.accepted(&Request::Stop);
    assert!(matches!(bench.end_of(id), EventKind::Failed { reason: Failure::Stopped, .. }));
    let (taken, end) = run(&mut bench, 2);
    assert!(matches!(end, EventKind::ProgramDone { exposures: 6, .. }), "{end:?}");
    assert_eq!(taken[0].trigger_number, 7);
    for pair in bench.hardware.triggers.windows(2) {
        assert!(pair[1].0 - pair[0].0 >= u64::from(pair[0].1.0) + 10_500, "{pair:?}");
    }
}

#[test]
fn sixty_four_shots_on_three_axes_run_in_order() {
    let mut bench = Bench::both_homed();
    let shots: Vec<Shot> = (0..64)
        .map(|i| match i % 4 {
            0 => Shot {
                axis: Axis::SensorCoarse,
                target: Nanometres(500_000 + 20_000 * i),
                settle_window: Nanometres(500),
                ..shot(0)
            },
            1 => Shot {
                axis: Axis::Lens,
                target: Nanometres(900_000 + 10_000 * i),
                settle_window: Nanometres(1_000),
                ..shot(0)
            },
            _ => shot(FAR + 2_000 * i),
        })
        .collect();
    load(&mut bench, &shots);
    let (taken, end) = run(&mut bench, 64);
    assert!(matches!(end, EventKind::ProgramDone { exposures: 64, .. }), "{end:?}");
    assert_eq!(taken.len(), 64);
    for (record, shot) in taken.iter().zip(&shots) {
        assert_eq!((record.axis, record.asked), (shot.axis, shot.target));
        let there = record.measured(shot.axis);
        assert!((there.0 - shot.target.0).abs() <= shot.settle_window.0, "{record:?}");
    }
    // Each record has the positions of all axes.
    for four in taken.chunks(4) {
        let [coarse, lens, .., fine] = four else { panic!("{four:?}") };
        assert!((fine.coarse.0 - coarse.asked.0).abs() <= 500, "{fine:?}");
        assert!((fine.lens.0 - lens.asked.0).abs() <= 1_000, "{fine:?}");
    }
}

#[test]
fn impossible_shots_and_programs_are_refused() {
    let mut bench = Bench::new(700.0);
    let wrong = |reason| Err(RequestError::Shot { index: 3, reason });
    for (bad, reason) in [
        (Shot { exposure: Micros(19), ..shot(FAR) }, ShotFault::Exposure),
        (Shot { exposure: Micros(1_000_001), ..shot(FAR) }, ShotFault::Exposure),
        (Shot { settle_window: Nanometres(0), ..shot(FAR) }, ShotFault::Settle),
        (Shot { settle_window: Nanometres(-5), ..shot(FAR) }, ShotFault::Settle),
        (Shot { settle_window: Nanometres(i32::MAX), ..shot(FAR) }, ShotFault::Settle),
        (Shot { settle_dwell: Micros(0), ..shot(FAR) }, ShotFault::Settle),
        (Shot { settle_dwell: Micros(u32::MAX), ..shot(FAR) }, ShotFault::Settle),
        (Shot { repeat: 0, ..shot(FAR) }, ShotFault::Repeat),
    ] {
        assert_eq!(bench.ask(&Request::LoadShot { index: 3, shot: bad }).1, wrong(reason));
    }
    let (_, beyond) = bench.ask(&Request::LoadShot { index: 3, shot: shot(200_000) });
    assert!(matches!(beyond, Err(RequestError::OutOfRange { axis: Axis::SensorFine, .. })), "{beyond:?}");
    let (_, index) = bench.ask(&Request::LoadShot { index: 64, shot: shot(FAR) });
    assert_eq!(index, Err(RequestError::Shot { index: 64, reason: ShotFault::Index }));
    load(&mut bench, &[shot(FAR)]);
    for (shots, index, reason) in [
        (2, 1, ShotFault::Missing),
        (0, 0, ShotFault::Index),
        (65, 65, ShotFault::Index),
        (255, 255, ShotFault::Index),
    ] {
        let (_, answer) = bench.ask(&Request::ArmProgram { shots });
        assert_eq!(answer, Err(RequestError::Shot { index, reason }));
    }
    let coarse = Shot { axis: Axis::SensorCoarse, target: Nanometres(0), ..shot(0) };
    load(&mut bench, &[shot(FAR), coarse]);
    let unhomed = RequestError::NotHomed { axis: Axis::SensorCoarse, state: PositionState::Unknown };
    assert_eq!(bench.ask(&Request::ArmProgram { shots: 2 }).1, Err(unhomed));
    let idle = RequestError::Program { state: ProgramState::Idle };
    assert_eq!(bench.ask(&RUN).1, Err(idle));
    bench.accepted(&Request::ArmProgram { shots: 1 });
    let request = bench.accepted(&RUN);
    let (_, busy) = bench.ask(&Request::LoadShot { index: 0, shot: shot(FAR) });
    assert_eq!(busy, Err(RequestError::Busy { request }));
    assert_eq!(bench.hardware.coarse.edges, 0);
}

#[test]
fn a_failed_program_is_reported_and_the_next_run_works() {
    let mut bench = Bench::homed();
    load(&mut bench, &[shot(FAR), shot(NEAR)]);
    let mut broken = |set: fn(&mut Bench)| {
        set(&mut bench);
        let start = bench.now;
        let (_, end) = run(&mut bench, 2);
        assert!(bench.now - start < 400_000, "within its deadline");
        bench.hardware.faults = bench::hardware::Faults::default();
        bench.run_ms(5);
        if bench.alarm().is_some() {
            bench.clear();
        }
        let (taken, after) = run(&mut bench, 2);
        assert!(
            matches!(after, EventKind::ProgramDone { exposures: 2, .. }) && taken.len() == 2,
            "{after:?}"
        );
        match end {
            EventKind::Failed { axis, reason, .. } => (axis, reason),
            other => panic!("did not fail: {other:?}"),
        }
    };
    assert_eq!(broken(|bench| bench.hardware.faults.no_strobe = true), (None, Failure::NoStrobe));
    let fine = Some(Axis::SensorFine);
    assert_eq!(broken(|bench| bench.hardware.faults.gauge = Some(None)), (fine, Failure::Gauge));
    assert_eq!(broken(|bench| bench.hardware.faults.gauge = Some(Some(0))), (fine, Failure::Gauge));
    let (axis, reason) = broken(|bench| bench.hardware.faults.piezo_dead = true);
    assert_eq!(axis, fine);
    let Failure::NotSettled { error } = reason else { panic!("{reason:?}") };
    assert!(error.0.abs() > 100_000, "{error:?}: it stood at the other end");
}

/// A missed conversion of the gauge. The board waits 300 ms for an axis to settle.
#[test]
fn an_axis_may_settle_again_after_a_long_exposure() {
    let mut bench = Bench::homed();
    load(&mut bench, &[Shot { repeat: 2, exposure: Micros(500_000), ..shot(FAR) }]);
    bench.accepted(&Request::ArmProgram { shots: 1 });
    bench.events.clear();
    let id = bench.accepted(&RUN);
    let is_done = |bench: &Bench| {
        bench.events.iter().any(|(_, event)| matches!(event.kind, EventKind::ShotDone { .. }))
    };
    while !is_done(&bench) {
        bench.tick();
    }
    bench.hardware.faults.gauge = Some(None);
    bench.tick();
    bench.hardware.faults.gauge = None;
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
}

#[test]
fn a_pushed_stage_ends_a_program_of_the_other_axis() {
    let mut bench = Bench::homed();
    load(&mut bench, &[Shot { repeat: 100, ..shot(FAR) }]);
    bench.accepted(&Request::ArmProgram { shots: 1 });
    let id = bench.accepted(&RUN);
    bench.run_ms(100);
    bench.hardware.coarse.turn(-64);
    let end = bench.end_of(id);
    let EventKind::Failed { axis: Some(Axis::SensorCoarse), reason: Failure::Following { .. }, .. } = end
    else {
        panic!("{end:?}")
    };
}

#[test]
fn stopping_the_piezo_keeps_it_where_it_is() {
    let mut bench = Bench::new(700.0);
    bench.work(&fine(FAR));
    let id = bench.accepted(&fine(NEAR));
    bench.run_ms(2);
    bench.accepted(&Request::Stop);
    assert!(matches!(bench.end_of(id), EventKind::Failed { reason: Failure::Stopped, .. }));
    bench.run_ms(30);
    let status = bench.status().fine;
    assert!((FAR + 1_000..NEAR - 1_000).contains(&status.measured.0), "{status:?}");
    assert!((status.measured.0 - status.asked.0).abs() <= 50 && !status.moving, "{status:?}");
}

#[test]
fn a_software_trigger_is_requested_after_settling() {
    let mut bench = Bench::new(700.0);
    load(&mut bench, &[Shot { mode: TriggerMode::Software, exposure: Micros(3_000), ..shot(FAR) }]);
    bench.accepted(&Request::ArmProgram { shots: 1 });
    let id = bench.accepted(&RUN);
    let ready = |bench: &Bench| {
        bench.events.iter().find_map(|(_, event)| match event.kind {
            EventKind::ShotReady { request, index: 0, repeat: 0, trigger_number, exposure } => {
                Some((request, trigger_number, exposure, event.time.0))
            }
            _ => None,
        })
    };
    while ready(&bench).is_none() {
        bench.tick();
    }
    let (request, number, exposure, time) = ready(&bench).expect("just seen");
    assert_eq!((request, number, exposure), (id, 0, Micros(3_000)));
    assert!((bench.hardware.piezo_nm - f64::from(FAR)).abs() <= 50.0, "settled");
    bench.hardware.exposed_by_host = Some((time + 40_000, time + 43_000));
    assert!(matches!(bench.end_of(id), EventKind::ProgramDone { exposures: 1, .. }));
    let record = shots_of(&bench)[0];
    assert_eq!(
        (record.trigger.0, record.strobe_start.0, record.strobe_end.0),
        (time, time + 40_000, time + 43_000)
    );
    assert!(bench.hardware.triggers.is_empty(), "no pulse");
    // A host that never triggers: the shot's patience ends, and the next run works.
    bench.hardware.exposed_by_host = None;
    let start = bench.now;
    let end = bench.work(&RUN);
    assert!(matches!(end, EventKind::Failed { reason: Failure::NoStrobe, axis: None, .. }), "{end:?}");
    assert!((5_000_000..5_100_000).contains(&(bench.now - start)));
}

fn shots_of(bench: &Bench) -> Vec<ShotRecord> {
    let taken = bench.events.iter().filter_map(|(_, event)| match &event.kind {
        EventKind::ShotDone { shot, .. } => Some(*shot),
        _ => None,
    });
    taken.collect()
}

#[test]
fn of_a_camera_that_runs_freely_the_first_frame_after_settling_counts() {
    let mut bench = Bench::new(700.0);
    let free = |nm| Shot { mode: TriggerMode::FreeRunning, ..shot(nm) };
    load(&mut bench, &[free(FAR), free(NEAR)]);
    bench.hardware.free_running = Some((33_333, 8_000));
    let (taken, end) = run(&mut bench, 2);
    assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
    assert_eq!(taken.len(), 2);
    for record in &taken {
        assert_eq!(record.strobe_start.0 % 33_333, 0, "its own time");
        assert!(record.strobe_start >= record.trigger, "begun after the position was settled");
        assert!(record.strobe_start.0 - record.trigger.0 <= 33_333, "the first such");
        assert_eq!(record.strobe_end.0 - record.strobe_start.0, 8_000);
    }
    assert!(bench.hardware.triggers.is_empty());
}

#[test]
fn a_pause_waits_for_the_exposure_and_a_resumed_program_settles_again() {
    let mut bench = Bench::homed();
    let coarse = Shot { axis: Axis::SensorCoarse, settle_window: Nanometres(1_000), ..shot(4_000_000) };
    load(&mut bench, &[Shot { exposure: Micros(20_000), ..shot(FAR) }, coarse]);
    bench.events.clear();
    bench.accepted(&Request::ArmProgram { shots: 2 });
    let not_running = RequestError::Program { state: ProgramState::Armed };
    assert_eq!(bench.ask(&Request::PauseProgram).1, Err(not_running));
    let id = bench.accepted(&RUN);
    while bench.hardware.triggers.is_empty() {
        bench.tick();
    }
    bench.accepted(&Request::PauseProgram);
    bench.run_ms(100);
    assert_eq!(shots_of(&bench).len(), 1, "the exposure under way is taken");
    let program = bench.status().program;
    assert_eq!((program.state, program.index, program.exposures), (ProgramState::Paused, 1, 1));
    assert!(bench.events.iter().any(|(_, event)| event.kind == EventKind::Paused { request: id, index: 1 }));
    let edges = bench.hardware.coarse.edges;
    bench.run_ms(100);
    assert_eq!(bench.hardware.coarse.edges, edges, "it stands");
    // Also on the way, and repeatedly.
    bench.accepted(&Request::ResumeProgram);
    bench.run_ms(200);
    bench.accepted(&Request::PauseProgram);
    bench.run_ms(400);
    assert_eq!(bench.status().program.state, ProgramState::Paused);
    bench.accepted(&Request::ResumeProgram);
    assert!(matches!(bench.end_of(id), EventKind::ProgramDone { exposures: 2, .. }));
    assert!((shots_of(&bench)[1].coarse.0 - 4_000_000).abs() <= 1_000);
    assert_eq!(bench.status().program.state, ProgramState::Armed, "and may be run again");
}

#[test]
fn a_program_resumed_during_braking_reaches_its_target() {
    for wait_ms in [1, 20, 60, 120, 200] {
        let mut bench = Bench::homed();
        let coarse = Shot { axis: Axis::SensorCoarse, settle_window: Nanometres(1_000), ..shot(6_000_000) };
        load(&mut bench, &[coarse]);
        bench.events.clear();
        bench.accepted(&Request::ArmProgram { shots: 1 });
        let id = bench.accepted(&RUN);
        bench.run_ms(600);
        bench.accepted(&Request::PauseProgram);
        bench.run_ms(wait_ms);
        bench.accepted(&Request::ResumeProgram);
        let end = bench.end_of(id);
        assert!(matches!(end, EventKind::ProgramDone { exposures: 1, .. }), "after {wait_ms} ms: {end:?}");
        assert!((shots_of(&bench)[0].coarse.0 - 6_000_000).abs() <= 1_000);
    }
}

#[test]
fn a_pause_and_its_end_between_two_shots_move_to_the_next_place() {
    // The pause comes during the first exposure, its end in each of the ticks around the exposure's.
    for ticks in 0..60 {
        let mut bench = Bench::new(700.0);
        load(&mut bench, &[Shot { exposure: Micros(1_000), ..shot(FAR) }, shot(NEAR)]);
        bench.events.clear();
        bench.accepted(&Request::ArmProgram { shots: 2 });
        let id = bench.accepted(&RUN);
        while bench.hardware.triggers.is_empty() {
            bench.tick();
        }
        bench.accepted(&Request::PauseProgram);
        for _ in 0..ticks {
            bench.tick();
        }
        bench.accepted(&Request::ResumeProgram);
        assert!(matches!(bench.end_of(id), EventKind::ProgramDone { exposures: 2, .. }));
        let shot = shots_of(&bench)[1];
        assert!((shot.fine.0 - NEAR).abs() <= 50, "after {ticks} ticks: {shot:?}");
        assert!((bench.hardware.piezo_at_trigger[1] - f64::from(NEAR)).abs() <= 60.0, "after {ticks} ticks");
    }
}

#[test]
fn a_changed_program_must_be_armed_again() {
    let mut bench = Bench::new(700.0);
    load(&mut bench, &[shot(FAR)]);
    bench.accepted(&Request::ArmProgram { shots: 1 });
    load(&mut bench, &[shot(NEAR)]);
    let idle = RequestError::Program { state: ProgramState::Idle };
    assert_eq!(bench.ask(&RUN).1, Err(idle));
}

#[test]
fn shots_come_from_below_wherever_they_came_from() {
    let mut bench = Bench::both_homed();
    let on = |axis, nm| Shot { axis, settle_window: Nanometres(1_000), ..shot(nm) };
    let targets = [3_000_000, 2_000_000, 2_001_000, 2_000_000, 5_000_000];
    let shots: Vec<Shot> =
        targets.iter().flat_map(|nm| [on(Axis::SensorCoarse, *nm), on(Axis::Lens, *nm)]).collect();
    load(&mut bench, &shots);
    bench.accepted(&Request::ArmProgram { shots: shots.len() as u8 });
    let id = bench.accepted(&RUN);
    let mut seen = 0;
    while !bench.events.iter().any(|(_, event)| bench::ends(&event.kind, id)) {
        bench.tick();
        if bench.hardware.triggers.len() > seen {
            let shot = &shots[seen];
            let motor = if shot.axis == Axis::Lens { &bench.hardware.lens } else { &bench.hardware.coarse };
            let off = motor.position_um() - f64::from(shot.target.0) / 1e3;
            assert!(off.abs() <= 0.5, "shot {seen}: {off} um");
            seen += 1;
        }
    }
    assert_eq!(seen, shots.len());
}
