//! Board to host: events.

use farnear_protocol::{
    BoardMicros, Event, EventKind, Micros, Nanometres,
    frame::Kind,
    message::{Axis, Calibration, DropReason, Failure, RecordName, ResetCause},
};

use super::{
    check, lists_every_variant,
    parts::{ALARMS, LEVELS, RECORD, alarm},
    wire,
};

fn failures() -> Vec<Failure> {
    vec![
        Failure::Stopped,
        Failure::HomeSwitchNotFound,
        Failure::HomeSwitchStuck,
        Failure::FarSwitch,
        Failure::HomeSwitch,
        Failure::Following { error: Nanometres(-4_000) },
        Failure::NotSettled { error: Nanometres(120) },
        Failure::NoStrobe,
        Failure::DriverFault,
        Failure::StepUnderrun,
        Failure::Gauge,
        Failure::Alarm { number: 12 },
        Failure::Implausible,
    ]
}

fn drop_reasons() -> [DropReason; 3] {
    [DropReason::NotSettled { error: Nanometres(-120) }, DropReason::CameraBusy, DropReason::NoStrobe]
}

fn calibrations() -> Vec<Calibration> {
    vec![
        Calibration::Travel { axis: Axis::SensorCoarse, length: Nanometres(13_600_000) },
        Calibration::Backlash { axis: Axis::Lens, backlash: Nanometres(4_125), spread: Nanometres(250) },
        Calibration::Piezo { gain_pm_per_code: 3_052, hysteresis_ppm: 120_000, creep_ppm_per_decade: 15_000 },
        Calibration::Gauge { gain_ppm: 1_019_600, offset: Nanometres(-784) },
    ]
}

fn table() -> Vec<EventKind> {
    let mut table = vec![
        EventKind::Started { cause: ResetCause::BrownOut },
        EventKind::Homed { request: 2, axis: Axis::SensorCoarse, shift: Nanometres(-125) },
        EventKind::MoveDone {
            request: 3,
            axis: Axis::Lens,
            asked: Nanometres(5_800_000),
            measured: Nanometres(5_800_125),
        },
        EventKind::ShotDone { request: 4, shot: RECORD },
        EventKind::ProgramDone { request: 4, exposures: 2 },
        EventKind::Failed { request: 5, axis: None, reason: Failure::Stopped },
    ];
    let axis = Some(Axis::SensorCoarse);
    table.extend(failures().into_iter().map(|reason| EventKind::Failed { request: 6, axis, reason }));
    table.extend(calibrations().into_iter().map(|result| EventKind::Calibrated { request: 7, result }));
    table.extend(ALARMS.map(|reason| EventKind::Alarm(alarm(reason))));
    table.extend([
        EventKind::AlarmCleared { number: 12 },
        EventKind::StillThere { request: 8 },
        EventKind::ShotReady {
            request: 9,
            index: 1,
            repeat: 300,
            trigger_number: 70_000,
            exposure: Micros(5_000),
        },
        EventKind::Paused { request: 9, index: 2 },
        EventKind::RecordRepaired { record: RecordName::Correction, sequence: 41 },
        EventKind::FrameTaken { request: 4, frame: 300, deviation: Nanometres(11), shot: RECORD },
    ]);
    let dropped = |reason| EventKind::FrameDropped { request: 4, frame: 301, index: 1, reason };
    table.extend(drop_reasons().map(dropped));
    table.push(EventKind::ContinuousDone { request: 4, exposures: 300, dropped: 1 });
    table.push(EventKind::Flash {
        request: 4,
        trigger_number: 70_000,
        levels: LEVELS,
        on: BoardMicros(2_000_300),
        off: BoardMicros(2_004_300),
    });
    table
}

#[test]
fn events() {
    lists_every_variant(&failures());
    lists_every_variant(&calibrations());
    lists_every_variant(&drop_reasons());
    lists_every_variant(&table());
    let event = |kind: &EventKind| Event { time: BoardMicros(1_000_000), kind: kind.clone() };
    let found: Vec<_> = table().iter().map(|kind| wire(Kind::Event, 7, &event(kind))).collect();
    check(
        &found,
        &[
            "0403040701010804030201c0843d0604d30f218d00",
            "0403040701010a04030201c0843d010207f90169420d1100",
            "0403040701011704030201c0843d0203028081c405fa82c40548ac54a600",
            "0403040701010b04030201c0843d030401200201b0df15be93c505b8df15f901f06080897a94897a9cb07a8827b22108cf00",
            "0403040701010f04030201c0843d0404021c84522400",
            "0403040701010a04030201c0843d05050105968e6f4d00",
            "0403040701010b04030201c0843d0506010105ab7354d800",
            "0403040701010b04030201c0843d05060106013d4353af00",
            "0403040701010b04030201c0843d050601060287125a3600",
            "0403040701010b04030201c0843d050601060311225d4100",
            "0403040701010b04030201c0843d0506010604b2b739df00",
            "0403040701010b04030201c0843d0506010805bf3e38e2d16100",
            "0403040701010b04030201c0843d0506010806f001962210a200",
            "0403040701010b04030201c0843d050601060708e6304600",
            "0403040701010b04030201c0843d050601060899fb8fd600",
            "0403040701010b04030201c0843d05060106090fcb88a100",
            "0403040701010b04030201c0843d050601060ab59a813800",
            "0403040701010b04030201c0843d050601070b0c7e549c7900",
            "0403040701010b04030201c0843d050601060c803fe2d100",
            "0403040701010a04030201c0843d060701098094fc0cec4f200700",
            "0403040701011404030201c0843d06070102ba40f40399ddccfb00",
            "0403040701011204030201c0843d060702ec17c0a907987504e4d57700",
            "0403040701011404030201c0843d060703a0bb7c9f0c0864983f00",
            "0403040701010e04030201c0843d070c22c0843d0570fdda8f00",
            "0403040701011304030201c0843d070c22c0843d01e6cdddf800",
            "0403040701011404030201c0843d070c22c0843d0202e247b05e00",
            "0403040701010f04030201c0843d070c22c0843d0308a7c30109a9f0fd00",
            "0403040701010f04030201c0843d070c22c0843d04054881e4e600",
            "0403040701011504030201c0843d070c22c0843d0502018dfa10ee00",
            "0403040701011304030201c0843d070c22c0843d064558b96600",
            "0403040701011404030201c0843d070c22c0843d074da6efa4c500",
            "0403040701011304030201c0843d070c22c0843d084275018100",
            "0403040701011304030201c0843d070c22c0843d09d44506f600",
            "0403040701011304030201c0843d070c22c0843d0a6e140f6f00",
            "0403040701011304030201c0843d070c22c0843d0bf824081800",
            "0403040701011304030201c0843d070c22c0843d0c5bb16c8600",
            "0403040701011304030201c0843d070c22c0843d0dcd816bf100",
            "0403040701010f04030201c0843d070c22c0843d0e05c2690b1c00",
            "0403040701011404030201c0843d070c22c0843d0f033909199c00",
            "0403040701011304030201c0843d070c22c0843d1014ed6d9200",
            "0403040701011304030201c0843d070c22c0843d1182dd6ae500",
            "0403040701010e04030201c0843d080ce90d234b00",
            "0403040701010e04030201c0843d0908b1f8555500",
            "0403040701011604030201c0843d0a0901ac02f0a2048827f99d758700",
            "0403040701010f04030201c0843d0b09026cbda09a00",
            "0403040701010f04030201c0843d0c0429e42cfd8600",
            "0403040701010e04030201c0843d0d04ac021601200201b0df15be93c505b8df15f901f06080897a94897a9cb07a882763f9aa3600",
            "0403040701010d04030201c0843d0e04ad020107ef01c9e3ce8a00",
            "0403040701011204030201c0843d0e04ad0201013911fce900",
            "0403040701011204030201c0843d0e04ad0201028340f57000",
            "0403040701011104030201c0843d0f04ac0201a63f7cac00",
            "0403040701011a04030201c0843d1004f0a204e80719ac8b7accaa7ab46bc5df00",
        ],
    );
}
