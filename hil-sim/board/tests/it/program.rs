//! Exposure programs: duration of a pair and standstill during exposures.

use crate::bench::{Bench, SILENCE, fine_shot};
use farnear_protocol::{
    EventKind, Micros, Nanometres, Request,
    message::{Failure, Shot, ShotRecord, TriggerMode},
};

/// Far and near settings of the 50 mm lens (933 and 886.81 mm).
const TRAVEL_NM: i32 = 156_270;
const EXPOSURE: Micros = Micros(5_000);
const WINDOW: Nanometres = Nanometres(50);
const FAR: Nanometres = Nanometres(10_000);

fn load_pair(bench: &mut Bench) {
    bench.arm(&[FAR, Nanometres(FAR.0 + TRAVEL_NM)].map(|at| fine_shot(at.0, EXPOSURE.0, WINDOW.0, 2_000)));
}

fn run_pair(bench: &mut Bench) -> Vec<ShotRecord> {
    let before = bench.events.len();
    let end = bench.run();
    assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
    let records = bench.events[before..].iter().filter_map(|event| match &event.kind {
        EventKind::ShotDone { shot, .. } => Some(*shot),
        _ => None,
    });
    records.collect()
}

#[test]
fn a_pair_is_fast_and_at_rest_during_exposures() {
    let mut bench = Bench::new(1);
    load_pair(&mut bench);
    // The first move after a start waits until the piezo cannot swing.
    run_pair(&mut bench);
    bench.rig.take_shots();
    for turn in 0..5 {
        let begin_ns = bench.report().now_ns;
        let records = run_pair(&mut bench);
        let shots = bench.rig.take_shots();
        assert_eq!((records.len(), shots.len()), (2, 2));
        let took_us = (shots[1].end_ns - begin_ns) / 1000;
        let moved_us = took_us - 2 * u64::from(EXPOSURE.0);
        println!("pair {turn}: {took_us} us, without its exposures {moved_us} us");
        assert!(moved_us <= 60_000, "a pair takes {moved_us} us besides its exposures");
        for (record, shot) in records.iter().zip(&shots) {
            let asked_um = f64::from(record.asked.0) * 1e-3;
            let off_nm = [shot.truth.piezo_min_um, shot.truth.piezo_um, shot.truth.piezo_max_um]
                .map(|um| 1e3 * (um - asked_um));
            println!(
                "  {} um: min, mean, max {off_nm:.1?} nm, gauge {} nm, settle {} us",
                asked_um,
                record.fine.0 - record.asked.0,
                record.settle.0
            );
            assert!(
                off_nm.iter().all(|nm| nm.abs() <= f64::from(WINDOW.0)),
                "{off_nm:?} nm during the exposure"
            );
            assert_eq!(record.trigger_number, shot.id);
            // Latency 20 us, six standard deviations of 2 us; stamps are whole microseconds.
            let latency_us = record.strobe_start.0 - record.trigger.0;
            assert!((7..=33).contains(&latency_us), "{latency_us} us");
            assert_eq!(record.strobe_end.0 - record.strobe_start.0, u64::from(EXPOSURE.0));
            assert!(record.strobe_start.0.abs_diff(shot.board_us) <= 1);
        }
    }
}

/// One cycle at 168 MHz, rounded up.
const CYCLE_NS: u64 = 6;

#[test]
fn exposures_have_the_requested_duration() {
    let mut bench = Bench::new(2);
    for exposure in [20, 21, 37, 100, 999, 10_000, 200_000] {
        bench.arm(&[Shot { repeat: 3, ..fine_shot(50_000, exposure, 200, 400) }]);
        let end = bench.run();
        assert!(matches!(end, EventKind::ProgramDone { exposures: 3, .. }), "{end:?}");
        let shots = bench.rig.take_shots();
        assert_eq!(shots.len(), 3);
        for shot in shots {
            // Timer edges are exact and the camera's latency cancels; the emulator stops at whole cycles.
            let length_ns = shot.end_ns - shot.begin_ns;
            assert!(
                length_ns.abs_diff(1000 * u64::from(exposure)) <= CYCLE_NS,
                "{length_ns} ns for {exposure} us"
            );
        }
    }
    assert_eq!(bench.report().missed_triggers, 0);
}

#[test]
fn a_software_triggered_shot_ends_with_the_strobe() {
    let mut bench = Bench::new(3);
    bench.arm(&[Shot { mode: TriggerMode::Software, repeat: 2, ..fine_shot(60_000, 4_000, 100, 1_000) }]);
    let answered = run_by_host(&mut bench);
    let records = records(&bench);
    let shots = bench.rig.take_shots();
    assert_eq!((answered, records.len(), shots.len()), (2, 2, 2), "{:?}", bench.events.last());
    for (record, shot) in records.iter().zip(&shots) {
        assert_eq!(record.trigger_number, shot.id);
        assert!(record.strobe_start.0.abs_diff(shot.board_us) <= 1);
        assert_eq!(record.strobe_end.0 - record.strobe_start.0, 4_000);
    }
    assert_eq!(bench.report().triggers, 0, "the board's own line stayed still");
}

#[test]
fn a_software_triggered_shot_is_taken_after_a_missed_strobe() {
    let mut bench = Bench::new(5);
    bench.access(|rig| rig.set_camera_ignores_triggers(true));
    bench.arm(&[fine_shot(60_000, 4_000, 100, 1_000)]);
    let end = bench.run();
    assert!(matches!(end, EventKind::Failed { reason: Failure::NoStrobe, .. }), "{end:?}");
    bench.arm(&[Shot { mode: TriggerMode::Software, ..fine_shot(60_000, 4_000, 100, 1_000) }]);
    assert_eq!((run_by_host(&mut bench), records(&bench).len()), (1, 1), "{:?}", bench.events.last());
}

/// Runs the armed program for half a second; the host triggers each shot that is ready. Returns their number.
fn run_by_host(bench: &mut Bench) -> usize {
    let run = bench.send(&Request::RunProgram { silence: SILENCE });
    let mut answered = 0;
    for _ in 0..1_000 {
        bench.rig.advance_us(500).expect("runs");
        bench.answers();
        let ready: Vec<u32> = bench
            .events
            .iter()
            .filter_map(|event| match event.kind {
                EventKind::ShotReady { request, trigger_number, .. } if request == run => {
                    Some(trigger_number)
                }
                _ => None,
            })
            .collect();
        for id in ready.into_iter().skip(answered) {
            answered += 1;
            bench.access(move |rig| rig.expose(4_000, id));
        }
    }
    answered
}

#[test]
fn free_running_uses_the_first_exposure_after_settling() {
    let mut bench = Bench::new(4);
    bench.access(|rig| rig.run_camera_freely(40_000, 5_000));
    bench.arm(
        &[20_000, 150_000]
            .map(|target| Shot { mode: TriggerMode::FreeRunning, ..fine_shot(target, 5_000, 100, 1_000) }),
    );
    let end = bench.run();
    assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
    let shots = bench.rig.take_shots();
    let records = records(&bench);
    assert_eq!(records.len(), 2);
    for record in records {
        let shot = shots.iter().find(|shot| record.strobe_start.0.abs_diff(shot.board_us) <= 1);
        let shot = shot.unwrap_or_else(|| panic!("no exposure of the camera fits {record:?}"));
        let asked_um = f64::from(record.asked.0) * 1e-3;
        for um in [shot.truth.piezo_min_um, shot.truth.piezo_max_um] {
            assert!((um - asked_um).abs() <= 0.1, "{um} um during the exposure, {asked_um} um asked");
        }
    }
}

#[test]
fn the_camera_and_the_board_number_exposures_alike() {
    let mut bench = Bench::new(4);
    let free = Shot { mode: TriggerMode::FreeRunning, repeat: 3, ..fine_shot(60_000, 5_000, 100, 1_000) };
    let triggered = |bench: &mut Bench| {
        bench.rig.take_shots();
        bench.arm(&[fine_shot(60_000, 4_000, 100, 1_000)]);
        let end = bench.run();
        assert!(matches!(end, EventKind::ProgramDone { exposures: 1, .. }), "{end:?}");
        let reported = records(bench).last().map(|record| record.trigger_number);
        (reported, bench.rig.take_shots().iter().map(|shot| shot.id).collect::<Vec<_>>())
    };
    bench.access(|rig| rig.run_camera_freely(40_000, 5_000));
    bench.arm(&[free]);
    let end = bench.run();
    assert!(matches!(end, EventKind::ProgramDone { exposures: 3, .. }), "{end:?}");
    bench.access(|rig| rig.run_camera_freely(0, 0));
    bench.rig.advance_us(50_000).expect("runs");
    assert_eq!(triggered(&mut bench), (Some(3), vec![3]));
    // The number of an exposure that never came is in the status only.
    bench.arm(&[free]);
    let end = bench.run();
    assert!(matches!(end, EventKind::Failed { reason: Failure::NoStrobe, .. }), "{end:?}");
    bench.status();
    assert_eq!(triggered(&mut bench), (Some(5), vec![5]));
}

fn records(bench: &Bench) -> Vec<ShotRecord> {
    let records = bench.events.iter().filter_map(|event| match &event.kind {
        EventKind::ShotDone { shot, .. } => Some(*shot),
        _ => None,
    });
    records.collect()
}
