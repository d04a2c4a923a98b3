use crate::bench::{Bench, SILENCE};
use farnear_protocol::{
    EventKind, Nanometres, Request, Response,
    message::{Axis, Calibration, Routine, SettingKey},
};

fn calibrate(bench: &mut Bench, routine: Routine) -> Calibration {
    match bench.carry_out(&Request::Calibrate { routine, silence: SILENCE }) {
        EventKind::Calibrated { result, .. } => result,
        other => panic!("{routine:?}: {other:?}"),
    }
}

fn set(bench: &mut Bench, key: SettingKey, value: i32) {
    let answer = bench.ask(&Request::WriteSetting { key, value });
    assert!(matches!(answer, Ok(Response::Setting(_))), "{answer:?}");
}

#[test]
fn calibration_finds_travel_and_backlash() {
    let mut bench = Bench::new(1);
    for (axis, key) in
        [(Axis::SensorCoarse, SettingKey::CoarseBacklashNm), (Axis::Lens, SettingKey::LensBacklashNm)]
    {
        set(&mut bench, key, 0);
        let Calibration::Backlash { backlash, spread, .. } =
            calibrate(&mut bench, Routine::Backlash { axis })
        else {
            panic!("another routine's result")
        };
        println!("{axis:?}: backlash {backlash:?}, spread {spread:?}");
        // 4 um of play; the switch repeats within a round, a step is 0.16 um.
        assert!((backlash.0 - 4_000).abs() <= 500, "{backlash:?}");
        assert!(spread.0 <= 500, "{spread:?}");
    }
    let Calibration::Travel { length, .. } =
        calibrate(&mut bench, Routine::Travel { axis: Axis::SensorCoarse })
    else {
        panic!("another routine's result")
    };
    println!("travel {length:?}");
    // 13.15 mm with the screw's error of 2 um and the switch's 0.3 um.
    assert!((length.0 - 13_150_000).abs() <= 3_500, "{length:?}");
}

#[test]
fn moves_reach_their_targets_from_either_side() {
    let mut bench = Bench::new(2);
    bench.home();
    let places = [4_000_000, 2_000_000, 4_000_000, 4_020_000, 4_000_000, 9_000_000, 4_000_000];
    let mut at_four = Vec::new();
    for nm in places {
        bench.move_to(Axis::SensorCoarse, Nanometres(nm));
        let um = bench.report().coarse.position_um;
        assert!((um - f64::from(nm) / 1e3).abs() <= 3.5, "{um} um at {nm} nm");
        if nm == 4_000_000 {
            at_four.push(um);
        }
    }
    let spread =
        at_four.iter().fold(f64::MIN, |a, b| a.max(*b)) - at_four.iter().fold(f64::MAX, |a, b| a.min(*b));
    println!("the same place from all sides within {spread} um");
    assert!(spread <= 0.4, "{at_four:?}");
}

#[test]
fn piezo_calibration_makes_moves_faster() {
    let mut bench = Bench::new(3);
    let settle = |bench: &mut Bench| {
        bench.move_to(Axis::SensorFine, Nanometres(20_000));
        let before = bench.report().now_ns;
        let end = bench.move_to(Axis::SensorFine, Nanometres(176_270));
        assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
        (bench.report().now_ns - before) as f64 / 1e6
    };
    let blind = settle(&mut bench);
    let Calibration::Piezo { gain_pm_per_code, hysteresis_ppm, creep_ppm_per_decade } =
        calibrate(&mut bench, Routine::Piezo)
    else {
        panic!("another routine's result")
    };
    println!(
        "{gain_pm_per_code} pm a code, hysteresis {hysteresis_ppm} ppm, creep {creep_ppm_per_decade} ppm"
    );
    assert!(gain_pm_per_code.abs_diff(3_052) <= 150);
    assert!(hysteresis_ppm.abs_diff(120_000) <= 15_000);
    assert!(creep_ppm_per_decade.abs_diff(15_000) <= 8_000);
    let knowing = settle(&mut bench);
    println!("far to near in {blind} ms, calibrated in {knowing} ms, communication included");
    assert!(knowing <= 17.0 && knowing <= blind + 1.0);
}
