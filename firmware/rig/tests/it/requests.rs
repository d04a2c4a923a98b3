//! Any sequence of requests: nothing panics, nothing leaves the limits, everything ends once.

use crate::bench::{self, Bench, SILENCE, ends};
use farnear_protocol::message::{
    Axis, CorrectionForm, CorrectionInfo, LightLevels, Routine, SettingKey, Shot, ShotLight, SunQuery,
    TriggerMode,
};
use farnear_protocol::{Micros, Nanometres, Request};
use proptest::prelude::*;

fn axes() -> impl Strategy<Value = Axis> {
    prop_oneof![Just(Axis::SensorCoarse), Just(Axis::SensorFine), Just(Axis::Lens)]
}

fn positions() -> impl Strategy<Value = Nanometres> {
    prop_oneof![any::<i32>(), -100..13_100_000i32, 0..200_000i32].prop_map(Nanometres)
}

fn silences() -> impl Strategy<Value = Micros> {
    prop_oneof![4 => Just(SILENCE), 1 => any::<u32>().prop_map(Micros), 2 => (100_000..400_000u32).prop_map(Micros)]
}

fn shots() -> impl Strategy<Value = Shot> {
    let modes =
        prop_oneof![Just(TriggerMode::Hardware), Just(TriggerMode::Software), Just(TriggerMode::FreeRunning)];
    (axes(), positions(), 0u32..3_000, 0i32..2_000, 0u32..3_000, 0u16..3, modes).prop_map(
        |(axis, target, exposure, window, dwell, repeat, mode)| Shot {
            axis,
            target,
            exposure: Micros(exposure),
            settle_window: Nanometres(window),
            settle_dwell: Micros(dwell),
            repeat,
            mode,
        },
    )
}

fn routines() -> impl Strategy<Value = Routine> {
    prop_oneof![
        axes().prop_map(|axis| Routine::Travel { axis }),
        axes().prop_map(|axis| Routine::Backlash { axis }),
        Just(Routine::Piezo)
    ]
}

fn settings() -> impl Strategy<Value = Request> {
    (0..SettingKey::ALL.len(), prop_oneof![any::<i32>(), 0..14_000_000i32, 0..100_000i32])
        .prop_map(|(index, value)| Request::WriteSetting { key: SettingKey::ALL[index], value })
}

fn maths() -> impl Strategy<Value = Request> {
    let form =
        prop_oneof![Just(CorrectionForm::Regions), Just(CorrectionForm::Blend), Just(CorrectionForm::Full)];
    let codes =
        || prop::collection::vec(any::<i16>(), 0..72).prop_map(|codes| codes.iter().copied().collect());
    let bits = prop::collection::vec(any::<i32>(), 0..40).prop_map(|bits| bits.iter().copied().collect());
    prop_oneof![
        (form, 0u16..1_100, any::<u16>(), any::<i32>(), any::<i32>()).prop_map(
            |(form, width, height, centre_um, half_span_um)| {
                Request::OpenCorrection(CorrectionInfo { form, width, height, centre_um, half_span_um })
            }
        ),
        Just(Request::LoadCorrection),
        Just(Request::StoreCorrection),
        (any::<u8>(), bits).prop_map(|(first, bits)| Request::PutCoefficients { first, bits }),
        (any::<u8>(), any::<u8>()).prop_map(|(first, count)| Request::GetCoefficients { first, count }),
        (any::<u16>(), any::<u16>(), any::<u16>(), any::<i16>(), codes()).prop_map(
            |(row, first, step, truth, codes)| Request::FitSamples { row, first, step, truth, codes }
        ),
        (0u16..1_100, 0u16..1_100, 0u32..2_000_000).prop_map(|(first, second, time)| Request::SetLights {
            levels: LightLevels { first, second },
            time: Micros(time),
            silence: Micros(200_000),
        }),
        (0u8..4, 0u32..6_000).prop_map(|(index, length)| Request::SetShotLight {
            index,
            light: Some(ShotLight {
                levels: LightLevels { first: 1_000, second: 0 },
                delay: Micros(100),
                length: Micros(length),
            }),
        }),
        Just(Request::SolveFit),
        (any::<u16>(), codes()).prop_map(|(first, codes)| Request::PutRow { first, codes }),
        any::<u16>().prop_map(|row| Request::CorrectRow { row }),
        (any::<u16>(), any::<u8>()).prop_map(|(first, count)| Request::GetRow { first, count }),
        (any::<i64>(), any::<i32>(), any::<i32>()).prop_map(|(unix_seconds, latitude_e7, longitude_e7)| {
            Request::Sun(SunQuery { unix_seconds, latitude_e7, longitude_e7, shadow: None })
        }),
    ]
}

fn requests() -> impl Strategy<Value = Request> {
    prop_oneof![
        1 => Just(Request::Hello),
        2 => Just(Request::Status),
        2 => (axes(), silences()).prop_map(|(axis, silence)| Request::Home { axis, silence }),
        8 => (axes(), positions(), silences())
            .prop_map(|(axis, target, silence)| Request::Move { axis, target, silence }),
        1 => Just(Request::Stop),
        1 => Just(Request::Halt),
        4 => (0u8..70, shots())
            .prop_map(|(index, shot)| Request::LoadShot { index: index % 5 * (1 + index / 64 * 60), shot }),
        2 => (0u8..5).prop_map(|shots| Request::ArmProgram { shots }),
        3 => silences().prop_map(|silence| Request::RunProgram { silence }),
        2 => (0u32..60_000, 0u32..4, silences()).prop_map(|(period, exposures, silence)| {
            Request::RunContinuously { period: Micros(period), exposures, silence }
        }),
        1 => Just(Request::PauseProgram),
        1 => Just(Request::ResumeProgram),
        2 => (routines(), silences()).prop_map(|(routine, silence)| Request::Calibrate { routine, silence }),
        1 => any::<u32>().prop_map(|number| Request::ReadEvent { number: number % 40 }),
        1 => (0u32..6).prop_map(|number| Request::ReadAlarm { number }),
        4 => (0u32..6).prop_map(|number| Request::ClearAlarm { number }),
        1 => settings(),
        1 => Just(Request::ReadCounters),
        4 => maths(),
    ]
}

const fn is_long(request: &Request) -> bool {
    matches!(
        request,
        Request::Home { .. }
            | Request::Move { .. }
            | Request::RunProgram { .. }
            | Request::RunContinuously { .. }
            | Request::Calibrate { .. }
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn no_sequence_of_requests_leaves_the_limits(
        sequence in prop::collection::vec((requests(), 0u64..400), 1..60), homed in any::<bool>()) {
        let mut bench = if homed { Bench::both_homed() } else { Bench::new(2_500.0) };
        bench.hardware.free_running = Some((33_000, 4_000));
        let mut begun = Vec::new();
        for (request, pause_ms) in sequence {
            let (id, answer) = bench.ask(&request);
            if answer.is_ok() && is_long(&request) {
                begun.push(id);
            }
            bench.run_ms(pause_ms);
        }
        bench.accepted(&Request::Stop);
        // A slow ramp set by the sequence brakes for seconds.
        for _ in 0..100 {
            let status = bench.status();
            if [status.coarse.request, status.fine.request, status.lens.request] == [None; 3] {
                break;
            }
            bench.run_ms(100);
        }
        let status = bench.status();
        prop_assert_eq!([status.coarse.request, status.fine.request, status.lens.request], [None; 3]);
        for motor in [&bench.hardware.coarse, &bench.hardware.lens] {
            // 0.5 mm of over-travel are for the switch search; moves stay inside 0 to 13 mm.
            prop_assert!(motor.leftmost >= -3_200, "{}", motor.leftmost);
            prop_assert!(motor.rightmost <= ((bench::motor::FAR_SWITCH_UM + 500.0) / bench::motor::STEP_UM) as i64);
            prop_assert!(motor.closest_edges_us > 24.9);
        }
        for id in begun {
            let ends = bench.events.iter().filter(|(_, event)| ends(&event.kind, id)).count();
            prop_assert_eq!(ends, 1, "request {} ends once", id);
        }
    }
}
