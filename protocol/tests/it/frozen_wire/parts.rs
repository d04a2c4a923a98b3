//! One of each message part; checks that no variant is missing.

use farnear_protocol::{
    BoardMicros, Micros, Nanometres,
    message::{
        Alarm, AlarmRecord, Axis, AxisStatus, CorrectionFault, CorrectionForm, CorrectionInfo, LightLevels,
        PositionState, ProgramState, ProgramStatus, QueryDeviations, RecordName, ResetCause, Setting,
        SettingKey, ShadowQuery, ShadowReliability, Shot, ShotFault, ShotRecord, SunQuery, TriggerMode,
    },
};

use super::lists_every_variant;

pub const SHOT: Shot = Shot {
    axis: Axis::SensorFine,
    target: Nanometres(178_136),
    exposure: Micros(5_000),
    settle_window: Nanometres(50),
    settle_dwell: Micros(1_000),
    repeat: 2,
    mode: TriggerMode::FreeRunning,
};

pub const RECORD: ShotRecord = ShotRecord {
    index: 1,
    repeat: 0,
    trigger_number: 2,
    axis: Axis::SensorFine,
    asked: Nanometres(178_136),
    coarse: Nanometres(5_809_375),
    fine: Nanometres(178_140),
    lens: Nanometres(-125),
    settle: Micros(12_400),
    trigger: BoardMicros(2_000_000),
    strobe_start: BoardMicros(2_000_020),
    strobe_end: BoardMicros(2_005_020),
    exposure: Micros(5_000),
};

pub const AXIS: AxisStatus = AxisStatus {
    state: PositionState::Homed,
    asked: Nanometres(5_800_000),
    measured: Nanometres(5_799_875),
    moving: true,
    request: Some(9),
};

pub const PROGRAM: ProgramStatus =
    ProgramStatus { state: ProgramState::Paused, shots: 3, index: 2, exposures: 300 };

pub const SETTING: Setting = Setting {
    key: SettingKey::LensSpeedNmPerS,
    value: 6_250_000,
    default: 6_000_000,
    min: 10_000,
    max: 10_000_000,
};

pub const CORRECTION: CorrectionInfo = CorrectionInfo {
    form: CorrectionForm::Blend,
    width: 640,
    height: 480,
    centre_um: 909_905,
    half_span_um: 30_024,
};

pub const SUN: SunQuery = SunQuery {
    unix_seconds: 1_342_526_400,
    latitude_e7: 523_000_000,
    longitude_e7: -15_600_000,
    shadow: None,
};

pub const SHADOW: ShadowQuery = ShadowQuery {
    azimuth_e7: 1_350_000_000,
    camera_height_mm: 3_000,
    distance_mm: 10_000,
    lateral_mm: -500,
    height_mm: 1_700,
    deviations: QueryDeviations {
        day_e3: 500,
        time_s: 60,
        latitude_e7: 100_000,
        longitude_e7: 100_001,
        azimuth_e7: 20_000_000,
        camera_height_mm: 50,
        height_mm: 70,
        distance_mm: 300,
    },
};

pub const ALARMS: [Alarm; 18] = [
    Alarm::EmergencyStop,
    Alarm::Halt,
    Alarm::DriverFault { axis: Axis::Lens },
    Alarm::Following { axis: Axis::SensorCoarse, error: Nanometres(-12_500) },
    Alarm::StepUnderrun { axis: Axis::SensorCoarse },
    Alarm::UnexpectedSwitch { axis: Axis::Lens, far: true },
    Alarm::Gauge,
    Alarm::HostSilence { request: 77 },
    Alarm::SupplyLow,
    Alarm::BrownOut,
    Alarm::Watchdog,
    Alarm::Panic,
    Alarm::StackOverflow,
    Alarm::QueueOverflow,
    Alarm::MotionInterrupted { axis: Axis::SensorCoarse },
    Alarm::RecordLost { record: RecordName::Program },
    Alarm::MemoryMissing,
    Alarm::ClockLost,
];

pub fn alarm(alarm: Alarm) -> AlarmRecord {
    AlarmRecord { number: 12, boot: 34, time: BoardMicros(1_000_000), alarm }
}

#[test]
fn enums_without_fields_keep_their_order() {
    lists_every_variant(&[Axis::SensorCoarse, Axis::SensorFine, Axis::Lens]);
    lists_every_variant(&[PositionState::Unknown, PositionState::Homed, PositionState::Lost]);
    lists_every_variant(&[
        ResetCause::PowerOn,
        ResetCause::Pin,
        ResetCause::Software,
        ResetCause::Watchdog,
        ResetCause::BrownOut,
        ResetCause::LowPower,
        ResetCause::Unknown,
    ]);
    lists_every_variant(&[
        RecordName::Settings,
        RecordName::Counters,
        RecordName::Alarms,
        RecordName::Program,
        RecordName::Correction,
    ]);
    lists_every_variant(&[
        ShotFault::Index,
        ShotFault::Missing,
        ShotFault::Exposure,
        ShotFault::Settle,
        ShotFault::Repeat,
    ]);
    lists_every_variant(&[TriggerMode::Hardware, TriggerMode::Software, TriggerMode::FreeRunning]);
    lists_every_variant(&[
        ProgramState::Idle,
        ProgramState::Armed,
        ProgramState::Running,
        ProgramState::Paused,
    ]);
    lists_every_variant(&[CorrectionForm::Regions, CorrectionForm::Blend, CorrectionForm::Full]);
    lists_every_variant(&[
        CorrectionFault::None,
        CorrectionFault::Size,
        CorrectionFault::Place,
        CorrectionFault::Coefficient,
        CorrectionFault::Underdetermined,
        CorrectionFault::TooManySamples,
        CorrectionFault::CoefficientTooLarge,
    ]);
    lists_every_variant(&[
        ShadowReliability::FirstOrder,
        ShadowReliability::ShadowNearCamera,
        ShadowReliability::EitherSide,
    ]);
    lists_every_variant(&SettingKey::ALL);
    lists_every_variant(&ALARMS);
}

#[test]
fn settings_keep_their_names_in_files() {
    let names = SettingKey::ALL.map(SettingKey::name);
    assert_eq!((names[0], names[7], names[22]), ("datum_nm", "coarse_backlash_nm", "strobe_deadline_us"));
    for (key, name) in SettingKey::ALL.iter().zip(names) {
        // Names equal the variants in snake case, so that no two can be swapped.
        let variant = format!("{key:?}").to_lowercase();
        assert_eq!(name.replace('_', ""), variant);
    }
}

/// Brightness that takes one byte and two.
pub const LEVELS: LightLevels = LightLevels { first: 1_000, second: 25 };
