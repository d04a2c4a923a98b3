//! Board to host: events.

use farnear_protocol::{
    BoardMicros, Event, EventKind, Micros, Nanometres,
    frame::Kind,
    message::{Axis, Calibration, Failure, RecordName, ResetCause},
};

use super::{
    check, lists_every_variant,
    parts::{ALARMS, RECORD, alarm},
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

fn calibrations() -> Vec<Calibration> {
    vec![
        Calibration::Travel { axis: Axis::SensorCoarse, length: Nanometres(13_600_000) },
        Calibration::Backlash { axis: Axis::Lens, backlash: Nanometres(4_125), spread: Nanometres(250) },
        Calibration::Piezo { gain_pm_per_code: 3_052, hysteresis_ppm: 120_000, creep_ppm_per_decade: 15_000 },
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
    ]);
    table
}

#[test]
fn events() {
    lists_every_variant(&failures());
    lists_every_variant(&calibrations());
    lists_every_variant(&table());
    let event = |kind: &EventKind| Event { time: BoardMicros(1_000_000), kind: kind.clone() };
    let found: Vec<_> = table().iter().map(|kind| wire(Kind::Event, 7, &event(kind))).collect();
    check(
        &found,
        &[
            "0402040701010804030201c0843d06043bd4da3400",
            "0402040701010a04030201c0843d010207f90188f45ffe00",
            "0402040701011704030201c0843d0203028081c405fa82c4056fc9712700",
            "0402040701010b04030201c0843d030401200201b0df15be93c505b8df15f901f06080897a94897a9cb07a8827d01920e500",
            "0402040701010f04030201c0843d0404028d153a8a00",
            "0402040701010a04030201c0843d05050105d545c9ca00",
            "0402040701010b04030201c0843d05060101054ac5063700",
            "0402040701010b04030201c0843d0506010601dcf5014000",
            "0402040701010b04030201c0843d050601060266a408d900",
            "0402040701010b04030201c0843d0506010603f0940fae00",
            "0402040701010b04030201c0843d050601060453016b3000",
            "0402040701010b04030201c0843d0506010805bf3e7ed9b60400",
            "0402040701010b04030201c0843d0506010806f001d01977c700",
            "0402040701010b04030201c0843d0506010607e95062a900",
            "0402040701010b04030201c0843d0506010608784ddd3900",
            "0402040701010b04030201c0843d0506010609ee7dda4e00",
            "0402040701010b04030201c0843d050601060a542cd3d700",
            "0402040701010b04030201c0843d050601070b0c26d47eae00",
            "0402040701010b04030201c0843d050601060c6189b03e00",
            "0402040701010a04030201c0843d060701098094fc0c72ccfa9800",
            "0402040701011404030201c0843d06070102ba40f403075e166400",
            "0402040701011604030201c0843d060702ec17c0a9079875d40ea6ec00",
            "0402040701010e04030201c0843d070c22c0843d0536c6bdea00",
            "0402040701011304030201c0843d070c22c0843d01a0f6ba9d00",
            "0402040701011404030201c0843d070c22c0843d02027cc46ac100",
            "0402040701010f04030201c0843d070c22c0843d0308a7c3012eccd57c00",
            "0402040701010f04030201c0843d070c22c0843d0405d6023e7900",
            "0402040701011504030201c0843d070c22c0843d0502014d9e38f900",
            "0402040701011304030201c0843d070c22c0843d060363de0300",
            "0402040701011404030201c0843d070c22c0843d074d386c7e5a00",
            "0402040701011304030201c0843d070c22c0843d08044e66e400",
            "0402040701011304030201c0843d070c22c0843d09927e619300",
            "0402040701011304030201c0843d070c22c0843d0a282f680a00",
            "0402040701011304030201c0843d070c22c0843d0bbe1f6f7d00",
            "0402040701011304030201c0843d070c22c0843d0c1d8a0be300",
            "0402040701011304030201c0843d070c22c0843d0d8bba0c9400",
            "0402040701010f04030201c0843d070c22c0843d0e055cead18300",
            "0402040701011404030201c0843d070c22c0843d0f03a78ac30300",
            "0402040701010e04030201c0843d080c01d6d8f200",
            "0402040701010e04030201c0843d09085923aeec00",
            "0402040701011604030201c0843d0a0901ac02f0a20488272d77061c00",
            "0402040701010f04030201c0843d0b0902fd2cc83400",
            "0402040701010f04030201c0843d0c042975bd952800",
        ],
    );
}
