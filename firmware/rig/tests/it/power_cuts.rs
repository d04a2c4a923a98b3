//! Power fails at any written byte: confirmed state persists, and a pending change is complete or absent.

use crate::bench::{Bench, home};
use farnear_protocol::message::{
    Alarm, Axis, CoefficientBits, CorrectionForm, CorrectionInfo, EventKind, ResetCause, SettingKey, Shot,
    TriggerMode,
};
use farnear_protocol::{Micros, Nanometres, Request, Response};
use std::collections::BTreeMap;

/// Cuts; `cargo xtask campaign` makes ten thousand.
const CUTS: u32 = 400;
/// Written settings, whose ranges have room.
const KEYS: [SettingKey; 4] = [
    SettingKey::CameraReadoutUs,
    SettingKey::DatumNm,
    SettingKey::PiezoHysteresisPpm,
    SettingKey::CoarseBacklashNm,
];

#[derive(Clone, PartialEq, Debug)]
struct Known {
    settings: BTreeMap<SettingKey, i32>,
    /// Numbers of the latched alarms; 0: the next one.
    alarms: Vec<u32>,
    homings: u32,
    shots: [Option<i32>; 3],
    coefficient: Option<i32>,
}

struct Random(u64);

impl Random {
    /// Marsaglia's xorshift (2003).
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

fn shot(target: i32) -> Shot {
    Shot {
        axis: Axis::SensorFine,
        target: Nanometres(target),
        exposure: Micros(1_000),
        settle_window: Nanometres(100),
        settle_dwell: Micros(1_000),
        repeat: 1,
        mode: TriggerMode::Hardware,
    }
}

/// Requests a change; returns the state once it is written.
fn change(bench: &mut Bench, random: &mut Random, before: &Known) -> Known {
    let mut after = before.clone();
    match random.below(8) {
        0..=2 => {
            let key = KEYS[random.below(4) as usize];
            let least = if key == SettingKey::DatumNm { 60_000_000 } else { 0 };
            let value = least + random.below(90_000) as i32;
            let answer = bench.ask(&Request::WriteSetting { key, value }).1;
            assert!(matches!(answer, Ok(Response::Setting(_))), "{answer:?}");
            after.settings.insert(key, value);
        }
        3 => {
            // Repeated halts are one alarm.
            let like = bench.alarm() == Some(Alarm::Halt);
            bench.accepted(&Request::Halt);
            if !like {
                after.alarms.push(0);
            }
        }
        4 if !before.alarms.is_empty() => {
            bench.clear();
            after.alarms.remove(0);
        }
        5 => {
            // The program is stored when armed or loaded: the shot is there or not.
            let (index, target) = (random.below(3) as u8, 20_000 + random.below(100_000) as i32);
            bench.accepted(&Request::LoadShot { index, shot: shot(target) });
            after.shots[usize::from(index)] = Some(target);
        }
        6 => {
            let info = CorrectionInfo {
                form: CorrectionForm::Full,
                width: 640,
                height: 480,
                centre_um: 900_000,
                half_span_um: 50_000,
            };
            bench.accepted(&Request::OpenCorrection(info));
            let value = random.below(1_000_000) as i32;
            let bits = CoefficientBits::from_slice(&[value]).expect("one fits");
            bench.accepted(&Request::PutCoefficients { first: 0, bits });
            bench.accepted(&Request::StoreCorrection);
            after.coefficient = Some(value);
        }
        _ if before.alarms.is_empty() => {
            bench.accepted(&home(Axis::SensorCoarse));
            after.homings += 1;
        }
        _ => {}
    }
    after
}

fn found(bench: &mut Bench) -> Known {
    let settings = KEYS
        .map(|key| match bench.ask(&Request::ReadSetting { key }).1 {
            Ok(Response::Setting(setting)) => (key, setting.value),
            other => panic!("no setting: {other:?}"),
        })
        .into();
    let homings = match bench.ask(&Request::ReadCounters).1 {
        Ok(Response::Counters(counters)) => counters.homings,
        other => panic!("no counters: {other:?}"),
    };
    let coefficient = match bench.ask(&Request::LoadCorrection).1 {
        Ok(_) => match bench.ask(&Request::GetCoefficients { first: 0, count: 1 }).1 {
            Ok(Response::Coefficients(bits)) => bits.first().copied(),
            other => panic!("no coefficients: {other:?}"),
        },
        Err(_) => None,
    };
    // Latched ones are read by clearing them, on a copy of the rig.
    let mut alarms = Vec::new();
    let rig = bench.rig.clone();
    while let Some(record) = bench.status().alarm {
        alarms.push(record.number);
        bench.accepted(&Request::ClearAlarm { number: record.number });
    }
    bench.rig = rig;
    let shots = core::array::from_fn(|index| bench.rig.shot(index as u8).map(|shot| shot.target.0));
    Known { settings, alarms, homings, shots, coefficient }
}

#[test]
fn whenever_the_power_goes_what_was_confirmed_is_there_and_nothing_is_silently_another() {
    let cuts = std::env::var("FARNEAR_POWER_CUTS").ok().and_then(|text| text.parse().ok()).unwrap_or(CUTS);
    let seed: u64 = std::env::var("FARNEAR_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(1);
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut bench = Bench::new(300.0);
    let (mut old, mut new, mut early) = (0, 0, 0);
    bench.run_ms(30);
    let mut known = found(&mut bench);
    let mut boot = bench.hello().boot;
    for cut in 0..cuts {
        // Mostly within the change's writes (a hundred bytes to two thousand); sometimes within the next start's.
        let at_start = random.below(5) == 0;
        let most = if at_start { 500 } else { [150, 400, 2_300][random.below(3) as usize] };
        let bytes = 1 + random.below(most) as usize;
        let after = if at_start {
            bench.cut_after = Some(bytes);
            start(&mut bench);
            if !bench.torn {
                // It has reported its number.
                let reported = bench.rig.boot();
                assert!(reported > boot, "boot {reported} after boot {boot}");
                boot = reported;
            }
            known.clone()
        } else {
            bench.cut_after = Some(bytes);
            change(&mut bench, &mut random, &known)
        };
        let moves = after.homings != known.homings;
        for _ in 0..if moves { 5_000 } else { 300 } {
            if bench.torn {
                break;
            }
            bench.tick();
        }
        early += u32::from(at_start && bench.torn);
        (bench.cut_after, bench.torn) = (None, false);
        start(&mut bench);
        bench.run_ms(30);
        let latched: Vec<Alarm> = bench.events.iter().filter_map(alarm).collect();
        let lost = latched.iter().any(|alarm| matches!(alarm, Alarm::RecordLost { .. }));
        assert!(!lost, "cut {cut} after {bytes} bytes lost a record: {latched:?}");
        let now = found(&mut bench);
        let reported = latched.iter().any(|alarm| matches!(alarm, Alarm::MotionInterrupted { .. }));
        let fits = |expected: &Known| {
            let mut expected = expected.clone();
            if reported {
                expected.alarms.push(0);
            }
            // An interrupted homing counts or does not.
            expected.homings = if moves { now.homings } else { expected.homings };
            fits(&now, &expected)
        };
        let (is_old, is_new) = (fits(&known), fits(&after));
        assert!(
            is_old || is_new,
            "cut {cut} after {bytes} bytes: {now:?} is neither {known:?} nor {after:?}; told: {latched:?}"
        );
        (old, new) = (old + u32::from(!is_new), new + u32::from(is_new));
        let boots = bench.hello().boot;
        assert!(boots > boot, "boot {boots} after boot {boot}");
        (known, boot) = (now, boots);
    }
    println!(
        "{cuts} cuts: {old} times the old, {new} times the new or no change; {early} of them in a start"
    );
    assert!(old * 10 > cuts && early * 20 > cuts, "the cuts hit nothing: {old} {early}");
}

fn start(bench: &mut Bench) {
    bench.next_id = 1;
    bench.restart(1, ResetCause::PowerOn);
}

fn alarm((_, event): &(u32, farnear_protocol::Event)) -> Option<Alarm> {
    match &event.kind {
        EventKind::Alarm(record) => Some(record.alarm),
        _ => None,
    }
}

fn fits(now: &Known, expected: &Known) -> bool {
    now.settings == expected.settings
        && now.alarms.len() == expected.alarms.len()
        && now.alarms.iter().zip(&expected.alarms).all(|(is, may)| *may == 0 || is == may)
        && now.homings == expected.homings
        && now.shots == expected.shots
        && now.coefficient == expected.coefficient
}
