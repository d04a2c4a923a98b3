//! Messages from host to board.

use farnear_protocol::{
    Call, Micros, Nanometres, Request,
    frame::Kind,
    message::{Axis, LinkRate, Routine, SettingKey, ShotLight, SunQuery},
};

use super::{
    SESSION, check, lists_every_variant,
    parts::{CORRECTION, LEVELS, SHADOW, SHOT, SUN},
    wire,
};

pub fn table() -> Vec<Request> {
    let silence = Micros(2_000_000);
    let codes = || [0, -1, 300, i16::MIN].as_slice().try_into().expect("it fits");
    vec![
        Request::Hello,
        Request::Status,
        Request::Home { axis: Axis::SensorCoarse, silence },
        Request::Move { axis: Axis::SensorFine, target: Nanometres(-1), silence },
        Request::Stop,
        Request::LoadShot { index: 1, shot: SHOT },
        Request::RunProgram { silence },
        Request::ReadEvent { number: 300 },
        Request::Reboot,
        Request::Halt,
        Request::ArmProgram { shots: 2 },
        Request::PauseProgram,
        Request::ResumeProgram,
        Request::Calibrate { routine: Routine::Travel { axis: Axis::Lens }, silence },
        Request::Calibrate { routine: Routine::Backlash { axis: Axis::SensorCoarse }, silence },
        Request::Calibrate { routine: Routine::Piezo, silence },
        Request::Calibrate { routine: Routine::Gauge, silence },
        Request::ReadAlarm { number: 12 },
        Request::ClearAlarm { number: 12 },
        Request::ReadSetting { key: SettingKey::DatumNm },
        Request::WriteSetting { key: SettingKey::StrobeDeadlineUs, value: -5_000 },
        Request::ReadCounters,
        Request::Sun(SUN),
        Request::Sun(SunQuery { shadow: Some(SHADOW), ..SUN }),
        Request::OpenCorrection(CORRECTION),
        Request::LoadCorrection,
        Request::StoreCorrection,
        Request::PutCoefficients {
            first: 80,
            bits: [0, 1 << 29, -1, i32::MIN].as_slice().try_into().expect("it fits"),
        },
        Request::GetCoefficients { first: 40, count: 40 },
        Request::FitSamples { row: 479, first: 3, step: 8, truth: -12_000, codes: codes() },
        Request::SolveFit,
        Request::PutRow { first: 72, codes: codes() },
        Request::CorrectRow { row: 479 },
        Request::GetRow { first: 568, count: 72 },
        Request::OpenSession,
        Request::RunContinuously { period: Micros(40_000), exposures: 15_000, silence },
        Request::SetLinkRate { rate: LinkRate::Baud921600 },
        Request::SetLights { levels: LEVELS, time: Micros(5_000_000), silence },
        Request::SetShotLight { index: 3, light: None },
        Request::SetShotLight {
            index: 3,
            light: Some(ShotLight { levels: LEVELS, delay: Micros(300), length: Micros(4_000) }),
        },
    ]
}

#[test]
fn requests() {
    lists_every_variant(&table());
    lists_every_variant(&[
        Routine::Travel { axis: Axis::Lens },
        Routine::Backlash { axis: Axis::Lens },
        Routine::Piezo,
        Routine::Gauge,
    ]);
    let call = |request| Call { session: SESSION, request };
    let found: Vec<_> =
        table().into_iter().map(|request| wire(Kind::Request, 0x0A0B_0C0D, &call(request))).collect();
    check(
        &found,
        &[
            "0f03010d0c0b0a04030201080706050576dd797600",
            "1403010d0c0b0a040302010807060501e0ed7e0100",
            "1003010d0c0b0a0403020108070605020880897a4963be6c00",
            "1903010d0c0b0a040302010807060503010180897a429227fe00",
            "1403010d0c0b0a0403020108070605046f19147100",
            "2003010d0c0b0a0403020108070605050101b0df15882764e80702028275c5cc00",
            "1703010d0c0b0a04030201080706050680897a3040bd2c00",
            "1603010d0c0b0a040302010807060507ac02d3902d2900",
            "1403010d0c0b0a0403020108070605084455a27800",
            "1403010d0c0b0a040302010807060509d265a50f00",
            "1503010d0c0b0a04030201080706050a02ffcbf37f00",
            "1403010d0c0b0a04030201080706050bfe04abe100",
            "1403010d0c0b0a04030201080706050c5d91cf7f00",
            "1003010d0c0b0a04030201080706050d090280897a6c75f8eb00",
            "1103010d0c0b0a04030201080706050d010880897a5794917c00",
            "1803010d0c0b0a04030201080706050d0280897a133ce74400",
            "1803010d0c0b0a04030201080706050d0380897a765b5bfc00",
            "1503010d0c0b0a04030201080706050e0cfc2327fc00",
            "1503010d0c0b0a04030201080706050f0cbd123ce500",
            "1003010d0c0b0a040302010807060510050850d02100",
            "1703010d0c0b0a040302010807060511168f4e67b8036f00",
            "1403010d0c0b0a0403020108070605123eacc08500",
            "1e03010d0c0b0a04030201080706051380cfaa800a80e3e2f203ffa5f00e05ff5d5c6200",
            "4103010d0c0b0a04030201080706051380cfaa800a80e3e2f203ffa5f00e0180f6ba870ab817904ee707a40df4033ca08d06a18d0680dac4093246ac028fd1e62000",
            "1f03010d0c0b0a040302010807060514018005e003a2896f90d5038ee7c82200",
            "1403010d0c0b0a0403020108070605159d39a41b00",
            "1403010d0c0b0a0403020108070605162768ad8200",
            "1203010d0c0b0a040302010807060517500410808080800401ffffffff0f69ba848800",
            "1603010d0c0b0a040302010807060518282807e003ba00",
            "1803010d0c0b0a040302010807060519df030308bfbb01040b01d804ffff0327dbd61e00",
            "1403010d0c0b0a04030201080706051a0c241b8b00",
            "1203010d0c0b0a04030201080706051b48040b01d804ffff03ad8b632b00",
            "1603010d0c0b0a04030201080706051cdf03e1c64b4a00",
            "1303010d0c0b0a04030201080706051db80448049327c700",
            "1403010d0c0b0a04030201080706051e15e0768c00",
            "1c03010d0c0b0a04030201080706051fc0b802987580897a199a08ce00",
            "1503010d0c0b0a040302010807060520016d56918900",
            "1e03010d0c0b0a040302010807060521e80719c096b10280897a6c2da89e00",
            "1103010d0c0b0a0403020108070605220305d2d53ad000",
            "1d03010d0c0b0a0403020108070605220301e80719ac02a01f5ab7208500",
        ],
    );
}
