//! Continuous capture through the public interface: period, dropped frames, and the end.

use crate::bench::{Bench, SILENCE, go};
use farnear_protocol::message::{
    Axis, DropReason, EventKind, Failure, ProgramState, SettingKey, Shot, ShotRecord, TriggerMode,
};
use farnear_protocol::{Micros, Nanometres, Request, RequestError, Response};

const FAR: i32 = 20_000;
const NEAR: i32 = 176_270;
const EXPOSURE: u32 = 5_000;
/// Less than move, exposure and read-out one after the other: 14.5, 5 and 10.5 ms.
const PERIOD: u64 = 25_000;

fn on(axis: Axis, nm: i32, window_nm: i32) -> Shot {
    Shot {
        axis,
        target: Nanometres(nm),
        exposure: Micros(EXPOSURE),
        settle_window: Nanometres(window_nm),
        settle_dwell: Micros(2_000),
        repeat: 1,
        mode: TriggerMode::Hardware,
    }
}

fn arm(bench: &mut Bench, shots: &[Shot]) {
    for (index, shot) in (0..).zip(shots) {
        bench.accepted(&Request::LoadShot { index, shot: *shot });
    }
    bench.accepted(&Request::ArmProgram { shots: shots.len() as u8 });
    bench.events.clear();
}

fn pair(bench: &mut Bench) {
    arm(bench, &[FAR, NEAR].map(|nm| on(Axis::SensorFine, nm, 50)));
}

const fn run(period: u64, exposures: u32) -> Request {
    Request::RunContinuously { period: Micros(period as u32), exposures, silence: SILENCE }
}

/// Result of each frame, numbered without a gap.
fn frames(bench: &Bench) -> Vec<Result<(Nanometres, ShotRecord), DropReason>> {
    let mut found = Vec::new();
    for (_, event) in &bench.events {
        let (number, what) = match event.kind {
            EventKind::FrameTaken { frame, deviation, shot, .. } => (frame, Ok((deviation, shot))),
            EventKind::FrameDropped { frame, reason, .. } => (frame, Err(reason)),
            _ => continue,
        };
        assert_eq!(number as usize, found.len(), "a frame without an event");
        found.push(what);
    }
    found
}

#[test]
fn far_and_near_follow_each_other_at_a_pace_held_to_the_microsecond() {
    let mut bench = Bench::new(700.0);
    pair(&mut bench);
    let end = bench.work(&run(PERIOD, 200));
    assert!(matches!(end, EventKind::ContinuousDone { exposures: 200, dropped: 0, .. }), "{end:?}");
    let frames = frames(&bench);
    let first = frames[0].expect("taken").1.trigger.0;
    for (number, frame) in (0_u32..).zip(frames) {
        let (deviation, shot) = frame.expect("taken");
        assert_eq!(shot.trigger.0, first + u64::from(number) * PERIOD);
        assert_eq!((u32::from(shot.index), shot.trigger_number), (number % 2, number));
        let target = if number % 2 == 0 { FAR } else { NEAR };
        assert!(deviation <= Nanometres(50) && (shot.fine.0 - target).abs() <= 50, "{deviation:?} {shot:?}");
        let truth = bench.hardware.piezo_at_trigger[number as usize];
        assert!((truth - f64::from(target)).abs() <= 60.0, "{truth}");
    }
}

#[test]
fn without_a_period_it_is_as_fast_as_piezo_and_camera() {
    let mut bench = Bench::new(700.0);
    pair(&mut bench);
    let end = bench.work(&run(0, 100));
    assert!(matches!(end, EventKind::ContinuousDone { exposures: 100, dropped: 0, .. }), "{end:?}");
    let frames = frames(&bench);
    let [first, last] = [0, 99].map(|number: usize| frames[number].expect("taken").1.trigger.0);
    // 14.5 ms to settle, the exposure, and a tick or two to see either.
    assert!((last - first) / 99 < 20_500, "{} us a frame", (last - first) / 99);
    // At one place the camera's read-out alone decides.
    arm(&mut bench, &[on(Axis::SensorFine, FAR, 50)]);
    bench.work(&run(0, 20));
    let shots: Vec<ShotRecord> = self::frames(&bench).iter().map(|frame| frame.expect("taken").1).collect();
    for pair in shots.windows(2) {
        let pause = pair[1].trigger.0 - pair[0].strobe_end.0;
        assert!((10_500..11_000).contains(&pause), "{pause} us");
    }
}

#[test]
fn a_dropped_frame_is_reported_and_its_shot_is_repeated() {
    let mut bench = Bench::new(700.0);
    pair(&mut bench);
    let id = bench.accepted(&run(PERIOD, 40));
    while frames(&bench).len() < 10 {
        bench.tick();
    }
    bench.hardware.faults.piezo_dead = true;
    bench.run_ms(55);
    bench.hardware.faults.piezo_dead = false;
    let end = bench.end_of(id);
    let EventKind::ContinuousDone { exposures: 40, dropped, .. } = end else { panic!("{end:?}") };
    let frames = frames(&bench);
    let lost = frames.iter().filter(|frame| frame.is_err()).count();
    assert!(lost >= 2 && lost as u32 == dropped, "{lost} {dropped}");
    assert!(frames.iter().flatten().map(|(_, shot)| shot.index).eq((0..40).map(|number| number % 2)));
    let first = frames[0].expect("taken").1.trigger.0;
    for (number, frame) in (0..).zip(&frames) {
        match frame {
            Ok((_, shot)) => assert_eq!(shot.trigger.0, first + number * PERIOD),
            Err(reason) => assert!(matches!(reason, DropReason::NotSettled { .. }), "{reason:?}"),
        }
    }
}

#[test]
fn one_missing_strobe_costs_a_frame_and_a_dead_camera_the_run() {
    let mut bench = Bench::new(700.0);
    pair(&mut bench);
    let id = bench.accepted(&run(PERIOD, 20));
    while bench.hardware.triggers.len() < 5 {
        bench.tick();
    }
    bench.hardware.faults.no_strobe = true;
    bench.run_ms(10);
    bench.hardware.faults.no_strobe = false;
    assert!(matches!(bench.end_of(id), EventKind::ContinuousDone { exposures: 20, .. }));
    let of_frames = frames(&bench);
    assert_eq!(of_frames[4], Err(DropReason::NoStrobe));
    let indices = of_frames.iter().flatten().map(|(_, shot)| shot.index);
    assert!(indices.eq((0..20).map(|number| number % 2)));
    // Until the camera's deadline has passed the next frames find it busy.
    let busy = of_frames.iter().filter(|frame| **frame == Err(DropReason::CameraBusy)).count();
    assert_eq!(of_frames.len(), 20 + 1 + busy);
    bench.hardware.faults.no_strobe = true;
    bench.events.clear();
    let end = bench.work(&run(PERIOD, 0));
    assert!(matches!(end, EventKind::Failed { axis: None, reason: Failure::NoStrobe, .. }), "{end:?}");
}

#[test]
fn periods_that_pass_during_an_exposure_are_reported_after_it() {
    const SHORT: u64 = 20_000;
    let mut bench = Bench::new(700.0);
    arm(&mut bench, &[Shot { mode: TriggerMode::FreeRunning, ..on(Axis::SensorFine, FAR, 50) }]);
    bench.hardware.free_running = Some((33_333, 8_000));
    let end = bench.work(&run(SHORT, 20));
    let EventKind::ContinuousDone { exposures: 20, dropped, .. } = end else { panic!("{end:?}") };
    let frames = frames(&bench);
    assert_eq!(frames.len() as u32, 20 + dropped);
    let first = frames[0].expect("taken").1.trigger.0;
    for (number, frame) in (0..).zip(&frames) {
        match frame {
            // Ordered up to two ticks ahead.
            Ok((_, shot)) => {
                assert!((0..400).contains(&(shot.trigger.0 - first - number * SHORT)), "{shot:?}")
            }
            Err(reason) => assert_eq!(*reason, DropReason::CameraBusy),
        }
    }
}

#[test]
fn a_run_continues_until_stopped_and_a_pause_restarts_the_period() {
    let mut bench = Bench::new(700.0);
    bench.run_ms(crate::bench::AFTER_START_MS);
    pair(&mut bench);
    let id = bench.accepted(&run(PERIOD, 0));
    bench.run_ms(1_000);
    bench.accepted(&Request::PauseProgram);
    bench.run_ms(777);
    assert_eq!(bench.status().program.state, ProgramState::Paused);
    let before = frames(&bench).len();
    assert_eq!(before, 40, "and none while it stands");
    bench.accepted(&Request::ResumeProgram);
    bench.run_ms(1_000);
    bench.accepted(&Request::Stop);
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::Failed { reason: Failure::Stopped, .. }), "{end:?}");
    let frames = frames(&bench);
    assert!(frames.iter().all(Result::is_ok) && frames.len() >= before + 39, "{}", frames.len());
    let moments = |from: usize, to: usize| -> Vec<u64> {
        frames[from..to].iter().flatten().map(|(_, shot)| shot.trigger.0).collect()
    };
    for moments in [moments(0, before), moments(before, frames.len())] {
        assert!(moments.windows(2).all(|pair| pair[1] - pair[0] == PERIOD), "{moments:?}");
    }
}

#[test]
fn a_pace_faster_than_the_camera_and_a_cycle_that_ends_too_close_are_refused() {
    let mut bench = Bench::both_homed();
    let idle = RequestError::Program { state: ProgramState::Idle };
    assert_eq!(bench.ask(&run(PERIOD, 0)).1, Err(idle));
    pair(&mut bench);
    let min = Micros(EXPOSURE + 10_500);
    assert_eq!(bench.ask(&run(15_499, 0)).1, Err(RequestError::Period { min }));
    let end = bench.work(&run(15_500, 1));
    assert!(matches!(end, EventKind::ContinuousDone { exposures: 1, .. }), "{end:?}");
    // Each shot is possible once; in the second round the coarse stage would hit the lens.
    let key = SettingKey::DistanceMinNm;
    assert!(matches!(
        bench.ask(&Request::WriteSetting { key, value: 47_500_000 }).1,
        Ok(Response::Setting(_))
    ));
    bench.work(&go(Axis::SensorCoarse, 2_000_000));
    bench.work(&go(Axis::Lens, 2_000_000));
    let (coarse, lens) = (Axis::SensorCoarse, Axis::Lens);
    arm(&mut bench, &[on(coarse, 100_000, 1_000), on(coarse, 2_000_000, 1_000), on(lens, 100_000, 1_000)]);
    let (_, refused) = bench.ask(&run(0, 0));
    assert!(matches!(refused, Err(RequestError::TooClose { .. })), "{refused:?}");
    let end = bench.work(&Request::RunProgram { silence: SILENCE });
    assert!(matches!(end, EventKind::ProgramDone { exposures: 3, .. }), "{end:?}");
}
