//! Host to board.

use farnear_protocol::{
    Micros, Nanometres, Request,
    frame::Kind,
    message::{Axis, Routine, SettingKey, SunQuery},
};

use super::{
    check, lists_every_variant,
    parts::{CORRECTION, SHADOW, SHOT, SUN},
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
    ]
}

#[test]
fn requests() {
    lists_every_variant(&table());
    lists_every_variant(&[
        Routine::Travel { axis: Axis::Lens },
        Routine::Backlash { axis: Axis::Lens },
        Routine::Piezo,
    ]);
    let found: Vec<_> = table().iter().map(|message| wire(Kind::Request, 0x0A0B_0C0D, message)).collect();
    check(
        &found,
        &[
            "0b02010d0c0b0a0403020105960aff2400",
            "0c02010d0c0b0a0403020101043af85300",
            "0c02010d0c0b0a04030201020880897ad10ebbda00",
            "1402010d0c0b0a0403020103010180897a598c450100",
            "1002010d0c0b0a04030201048fce922300",
            "1c02010d0c0b0a04030201050101b0df15882764e8070202e49b8b1500",
            "1302010d0c0b0a040302010680897a0fe5fd4f00",
            "1202010d0c0b0a0403020107ac02ce76e46f00",
            "1002010d0c0b0a0403020108a482242a00",
            "1002010d0c0b0a040302010932b2235d00",
            "1102010d0c0b0a040302010a0250afabdf00",
            "1002010d0c0b0a040302010b1ed32db300",
            "1002010d0c0b0a040302010cbd46492d00",
            "0c02010d0c0b0a040302010d090280897a776b9a1500",
            "0d02010d0c0b0a040302010d010880897a4c8af38200",
            "1402010d0c0b0a040302010d0280897a8b51e2f200",
            "1102010d0c0b0a040302010e0c53477f5c00",
            "1102010d0c0b0a040302010f0c1276644500",
            "0c02010d0c0b0a040302011005a734888100",
            "1302010d0c0b0a0403020111168f4e581d430c00",
            "1002010d0c0b0a0403020112de7b46d700",
            "1a02010d0c0b0a040302011380cfaa800a80e3e2f203ffa5f00e0541589f7f00",
            "3d02010d0c0b0a040302011380cfaa800a80e3e2f203ffa5f00e0180f6ba870ab817904ee707a40df4033ca08d06a18d0680dac4093246ac02e355682300",
            "1b02010d0c0b0a0403020114018005e003a2896f90d503675d7cba00",
            "1002010d0c0b0a04030201157dee224900",
            "1002010d0c0b0a0403020116c7bf2bd000",
            "0e02010d0c0b0a0403020117500410808080800401ffffffff0f796091fc00",
            "1202010d0c0b0a040302011828281a06cafc00",
            "1402010d0c0b0a0403020119df030308bfbb01040b01d804ffff0399de150300",
            "1002010d0c0b0a040302011aecf39dd900",
            "0e02010d0c0b0a040302011b48040b01d804ffff0377030db700",
            "1202010d0c0b0a040302011cdf03fc20820c00",
            "1302010d0c0b0a040302011db804483f3667a400",
        ],
    );
}
