//! The calibration routines through the public interface.

use crate::bench::motor::{FAR_SWITCH_UM, PLAY, STEP_UM};
use crate::bench::{self, Bench, SILENCE, failure, go, home};
use farnear_protocol::message::{
    Axis, Calibration, EventKind, Failure, PositionState, ResetCause, Routine, SettingKey,
};
use farnear_protocol::{Nanometres, Request, RequestError, Response};

fn calibrate(routine: Routine) -> Request {
    Request::Calibrate { routine, silence: SILENCE }
}

fn result(end: &EventKind) -> Calibration {
    match end {
        EventKind::Calibrated { result, .. } => *result,
        other => panic!("{other:?}"),
    }
}

fn setting(bench: &mut Bench, key: SettingKey) -> i32 {
    match bench.ask(&Request::ReadSetting { key }).1 {
        Ok(Response::Setting(setting)) => setting.value,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_travel_is_the_way_between_the_switches() {
    let mut bench = Bench::new(6_000.0);
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        let Calibration::Travel { axis: of, length } =
            result(&bench.work(&calibrate(Routine::Travel { axis })))
        else {
            panic!("another routine's result")
        };
        assert_eq!(of, axis);
        assert!((f64::from(length.0) / 1e3 - FAR_SWITCH_UM).abs() <= 0.5, "{length:?}");
    }
    let status = bench.status();
    assert_eq!((status.coarse.state, status.lens.state), (PositionState::Homed, PositionState::Homed));
    assert!(status.coarse.measured.0.abs() <= 300 && status.lens.measured.0.abs() <= 300, "back");
    assert_eq!(bench.alarm(), None, "the far switch was expected");
}

#[test]
fn the_backlash_is_found_kept_and_taken_out() {
    let mut bench = Bench::new(2_000.0);
    for (axis, key) in
        [(Axis::SensorCoarse, SettingKey::CoarseBacklashNm), (Axis::Lens, SettingKey::LensBacklashNm)]
    {
        bench.ask(&Request::WriteSetting { key, value: 0 }).1.expect("0 is allowed");
        let end = bench.work(&calibrate(Routine::Backlash { axis }));
        let Calibration::Backlash { backlash, spread, .. } = result(&end) else { panic!("{end:?}") };
        let truth = PLAY as f64 * STEP_UM;
        // The switch is read every 200 us at a pulse a millisecond: half a step at each edge, and a count.
        assert!((f64::from(backlash.0) / 1e3 - truth).abs() <= 0.35, "{backlash:?} for {truth} um");
        assert!(spread.0 <= 300, "{spread:?}");
        assert_eq!(setting(&mut bench, key), backlash.0);
    }
    for target in [3_000_000, 1_000_000, 2_000_000] {
        bench.work(&go(Axis::SensorCoarse, target));
        let off = bench.hardware.coarse.position_um() - f64::from(target) / 1e3;
        assert!(off.abs() <= 0.6, "{off} um");
    }
}

#[test]
fn with_the_backlash_set_to_0_moves_come_from_both_sides() {
    let mut bench = Bench::homed();
    let key = SettingKey::CoarseBacklashNm;
    bench.ask(&Request::WriteSetting { key, value: 0 }).1.expect("0 is allowed");
    bench.work(&bench::home(Axis::SensorCoarse));
    let mut places = Vec::new();
    for target in [1_000_000, 2_000_000, 3_000_000, 2_000_000] {
        bench.work(&go(Axis::SensorCoarse, target));
        places.push(bench.hardware.coarse.position_um());
    }
    let play = places[3] - places[1];
    assert!((play - PLAY as f64 * STEP_UM).abs() < 0.3, "{play} um between the two sides");
}

#[test]
fn the_piezo_is_swept_and_its_figures_are_settings() {
    let mut bench = Bench::new(700.0);
    bench.work(&go(Axis::SensorFine, 120_000));
    let end = bench.work(&calibrate(Routine::Piezo));
    let Calibration::Piezo { gain_pm_per_code, hysteresis_ppm, creep_ppm_per_decade } = result(&end) else {
        panic!("{end:?}")
    };
    // The bench's piezo has neither hysteresis nor creep.
    assert!(gain_pm_per_code.abs_diff(3_052) < 5, "{gain_pm_per_code}");
    assert!(hysteresis_ppm < 2_000 && creep_ppm_per_decade < 500, "{hysteresis_ppm}, {creep_ppm_per_decade}");
    assert_eq!(setting(&mut bench, SettingKey::PiezoGainPmPerCode), gain_pm_per_code as i32);
    assert_eq!(bench.hardware.dac, 0, "relaxed again");
    assert!(matches!(bench.work(&go(Axis::SensorFine, 20_000)), EventKind::MoveDone { .. }));
}

#[test]
fn a_routine_occupies_the_rig_and_can_be_stopped() {
    let mut bench = Bench::new(2_000.0);
    for routine in [Routine::Travel { axis: Axis::SensorFine }, Routine::Backlash { axis: Axis::SensorFine }]
    {
        assert_eq!(bench.ask(&calibrate(routine)).1, Err(RequestError::NoSuchRoutine));
    }
    for routine in [Routine::Travel { axis: Axis::Lens }, Routine::Piezo] {
        let request = bench.accepted(&calibrate(routine));
        bench.run_ms(300);
        assert_eq!(bench.ask(&go(Axis::SensorFine, 20_000)).1, Err(RequestError::Busy { request }));
        bench.accepted(&Request::Stop);
        assert_eq!(failure(&bench.end_of(request)), Failure::Stopped);
    }
    bench.work(&go(Axis::SensorFine, 20_000));
    assert!((bench.hardware.piezo_nm - 20e3).abs() <= 50.0);
}

#[test]
fn a_dead_gauge_ends_the_sweep_and_a_missing_switch_the_travel() {
    let mut bench = Bench::new(2_000.0);
    let id = bench.accepted(&calibrate(Routine::Piezo));
    bench.run_ms(100);
    bench.hardware.faults.gauge = Some(None);
    assert_eq!(failure(&bench.end_of(id)), Failure::Gauge);
    bench.hardware.faults.gauge = None;
    bench.run_ms(1);
    bench.clear();
    bench.hardware.coarse.faults.far_switch = Some(false);
    let end = bench.work(&calibrate(Routine::Travel { axis: Axis::SensorCoarse }));
    assert_eq!(failure(&end), Failure::Implausible);
    assert!(bench.status().coarse.measured <= Nanometres(14_600_000));
}

#[test]
fn stage_a_is_homed_only_where_it_is_known_how_far_the_piezo_holds_its_switch_away() {
    // Found by the campaign: a gauge that failed while the piezo was lowered was used, and position 0 was off by 59 um.
    let mut bench = Bench::homed();
    bench.work(&go(Axis::SensorFine, 100_000));
    bench.hardware.faults.gauge = Some(None);
    bench.run_ms(100);
    bench.clear();
    assert_eq!(failure(&bench.work(&home(Axis::SensorCoarse))), Failure::Gauge);
    bench.hardware.faults.gauge = None;
    bench.run_ms(1);
    assert!(
        matches!(bench.work(&home(Axis::SensorCoarse)), EventKind::Homed { shift, .. } if shift.0.abs() < 5_000)
    );
    // A lowered piezo displaces nothing, for any last gauge reading.
    bench.restart(2, ResetCause::Software);
    bench.run_ms(50);
    bench.hardware.faults.gauge = Some(None);
    bench.run_ms(200);
    bench.open_session();
    bench.clear();
    assert!(matches!(bench.work(&home(Axis::SensorCoarse)), EventKind::Homed { .. }));
    let off = f64::from(bench.status().coarse.measured.0) - 1e3 * bench.hardware.coarse.position_um();
    assert!(off.abs() < 10e3, "{off} nm");
}

#[test]
fn a_routine_drives_the_piezo_only_from_a_known_code() {
    for (piezo_code, left_at) in [(Some(50_000), 0), (None, 50_000)] {
        for routine in [Routine::Piezo, Routine::Gauge] {
            let mut bench = Bench::new(2_000.0);
            bench.hardware.dac = 50_000;
            bench.hardware.faults.gauge = Some(None);
            bench.reset(piezo_code);
            let mut before = bench.hardware.dac;
            let id = bench.accepted(&calibrate(routine));
            // Ramp, 0.1 s, and swing, 0.2 s.
            for _ in 0..2_000 {
                let dac = bench.hardware.dac;
                assert!(dac.abs_diff(before) <= 200, "{dac} after {before}");
                before = dac;
                bench.tick();
            }
            assert_eq!(failure(&bench.end_of(id)), Failure::Gauge);
            assert_eq!((bench.hardware.dac, bench.status().fine.moving), (left_at, false));
        }
    }
}

#[test]
fn stage_a_is_homed_without_a_gauge_where_the_piezo_has_not_been_driven() {
    let mut bench = Bench::new(2_000.0);
    bench.hardware.faults.gauge = Some(None);
    bench.reset(Some(0));
    assert!(matches!(bench.work(&home(Axis::SensorCoarse)), EventKind::Homed { .. }));
}

#[test]
fn a_changed_backlash_or_gauge_scale_requires_homing() {
    let (none, coarse, lens) = ([false; 2], [true, false], [false, true]);
    for (key, value, lost) in [
        (SettingKey::CoarseBacklashNm, 3_000, coarse),
        (SettingKey::LensBacklashNm, 3_000, lens),
        (SettingKey::GaugeGainPpm, 1_010_000, coarse),
        (SettingKey::GaugeOffsetNm, 500, coarse),
        (SettingKey::CameraReadoutUs, 9_000, none),
    ] {
        let mut bench = Bench::both_homed();
        let unchanged = setting(&mut bench, key);
        for (value, lost) in [(unchanged, none), (value, lost)] {
            bench.ask(&Request::WriteSetting { key, value }).1.expect("in range");
            let status = bench.status();
            let found = [status.coarse.state, status.lens.state].map(|state| state == PositionState::Lost);
            assert_eq!(found, lost, "{key:?} = {value}");
        }
    }
}

#[test]
fn a_routine_that_would_pass_the_piezos_limits_is_refused() {
    let mut bench = Bench::new(2_000.0);
    let outside = |bench: &mut Bench, routine| match bench.ask(&calibrate(routine)).1 {
        Err(RequestError::OutOfRange { axis: Axis::SensorFine, asked, .. }) => asked.0,
        other => panic!("{routine:?}: {other:?}"),
    };
    let limit = |bench: &mut Bench, key, value| {
        bench.ask(&Request::WriteSetting { key, value }).1.expect("in range");
    };
    limit(&mut bench, SettingKey::FineMaxNm, 179_000);
    assert_eq!(outside(&mut bench, Routine::Piezo), 195_000);
    assert_eq!(outside(&mut bench, Routine::Gauge), 180_000);
    limit(&mut bench, SettingKey::FineMaxNm, 180_000);
    limit(&mut bench, SettingKey::FineMinNm, 21_000);
    assert_eq!(outside(&mut bench, Routine::Gauge), 20_000);
    limit(&mut bench, SettingKey::FineMinNm, 20_000);
    bench.accepted(&calibrate(Routine::Gauge));
}

#[test]
fn the_piezo_rests_while_stage_a_is_homed() {
    let mut bench = Bench::homed();
    let request = bench.accepted(&go(Axis::SensorFine, 100_000));
    assert_eq!(bench.ask(&home(Axis::SensorCoarse)).1, Err(RequestError::Busy { request }));
    bench.end_of(request);
    let request = bench.accepted(&home(Axis::SensorCoarse));
    assert_eq!(bench.ask(&go(Axis::SensorFine, 20_000)).1, Err(RequestError::Busy { request }));
    assert!(matches!(bench.end_of(request), EventKind::Homed { .. }));
    bench.work(&go(Axis::SensorFine, 20_000));
}
