//! Board to host: responses and errors.

use farnear_protocol::{
    BoardMicros, Event, EventKind, Micros, Nanometres, RequestError, Response,
    frame::Kind,
    message::{
        Alarm, Axis, AxisStatus, Capabilities, CorrectionFault, Counters, Hello, LightFault, Limits,
        LinkCounters, PositionState, ProgramState, ResetCause, ShadowAnswer, ShadowReliability, ShotFault,
        Status, SunAnswer,
    },
};

use super::{
    check, lists_every_variant,
    parts::{AXIS, CORRECTION, PROGRAM, SETTING, alarm},
    wire,
};

pub fn hello() -> Hello {
    Hello {
        protocol_min: 3,
        protocol_current: 3,
        schema_key: 0x1122_3344_5566_7788,
        board: "nucleo-f429zi".try_into().expect("fits"),
        firmware: "0.1.0".try_into().expect("fits"),
        unique_id: *b"unique-id-12",
        boot: 3,
        reset_cause: ResetCause::Software,
        emulated: true,
        capabilities: Capabilities {
            sensor_coarse: true,
            sensor_fine: true,
            strobe: true,
            lens: true,
            memory: true,
            emergency_stop: false,
        },
        limits: Limits {
            datum: Nanometres(47_000_000),
            coarse_min: Nanometres(0),
            coarse_max: Nanometres(13_000_000),
            coarse_step_pm: 156_250,
            fine_min: Nanometres(5_000),
            fine_max: Nanometres(195_000),
            shots_max: 64,
            exposure_min: Micros(100),
            exposure_max: Micros(1_000_000),
            lens_min: Nanometres(0),
            lens_max: Nanometres(12_000_000),
            lens_step_pm: 156_250,
            distance_min: Nanometres(46_000_000),
            silence_min: Micros(100_000),
            silence_max: Micros(60_000_000),
            row_pixels_max: 1024,
        },
        last_id: 77,
        outstanding: 8,
    }
}

pub fn status() -> Status {
    Status {
        time: BoardMicros(1_234_567_890),
        coarse: AXIS,
        fine: AxisStatus { state: PositionState::Lost, moving: false, request: None, ..AXIS },
        lens: AxisStatus { state: PositionState::Unknown, asked: Nanometres(-125), ..AXIS },
        home_switch: true,
        far_switch: false,
        lens_home_switch: false,
        lens_far_switch: true,
        emergency_stop: false,
        supply_low: true,
        alarm: Some(alarm(Alarm::Halt)),
        program: PROGRAM,
        next_event: 4,
        triggers: 2,
        steps: 37_120,
        link: LinkCounters { frames: 10, bad_frames: 1, repeated: 2, stale: 3, overflowed: 300 },
    }
}

fn responses() -> Vec<Response> {
    let sun = SunAnswer { elevation_deg: 58.5, azimuth_deg: 171.25, shadow: None };
    let angle = ShadowAnswer::Angle {
        beta_deg: 112.5,
        sigma_beta_deg: 0.75,
        mirrored: true,
        length_m: 1.5,
        reliability: ShadowReliability::FirstOrder,
    };
    let shadow = |shadow| Response::Sun(SunAnswer { shadow: Some(shadow), ..sun });
    vec![
        Response::Hello(hello()),
        Response::Status(status()),
        Response::Status(Status { alarm: None, ..status() }),
        Response::Accepted,
        Response::Event(Event {
            time: BoardMicros(77),
            kind: EventKind::Started { cause: ResetCause::Watchdog },
        }),
        Response::Alarm(alarm(Alarm::SupplyLow)),
        Response::Setting(SETTING),
        Response::Counters(Counters {
            boots: 3,
            alarms: 1,
            triggers: 5_000_000_000,
            coarse_steps: 1_000_000,
            lens_steps: 300,
            homings: 2,
            repaired: 1,
        }),
        Response::Sun(sun),
        shadow(angle),
        shadow(ShadowAnswer::SunTooLow),
        shadow(ShadowAnswer::SunOverhead),
        shadow(ShadowAnswer::Senseless),
        Response::Correction(CORRECTION),
        Response::Coefficients([1 << 29, -3].as_slice().try_into().expect("fits")),
        Response::Row([-32_768, 32_767].as_slice().try_into().expect("fits")),
    ]
}

fn errors() -> Vec<RequestError> {
    vec![
        RequestError::Version { min: 1, current: 2 },
        RequestError::Boot { current: 4 },
        RequestError::Malformed,
        RequestError::IdReused,
        RequestError::OutOfRange {
            axis: Axis::SensorCoarse,
            asked: Nanometres(13_000_001),
            min: Nanometres(0),
            max: Nanometres(13_000_000),
        },
        RequestError::NotHomed { axis: Axis::SensorCoarse, state: PositionState::Unknown },
        RequestError::Busy { request: 8 },
        RequestError::CannotHome { axis: Axis::SensorFine },
        RequestError::Shot { index: 3, reason: ShotFault::Missing },
        RequestError::EventGone { oldest: 5, next: 21 },
        RequestError::Alarm { number: 12, alarm: Alarm::HostSilence { request: 77 } },
        RequestError::NoSuchAlarm { latched: 0, last: 12 },
        RequestError::AlarmRemains { alarm: Alarm::EmergencyStop },
        RequestError::TooClose { distance: Nanometres(45_999_999), min: Nanometres(46_000_000) },
        RequestError::Silence { min: Micros(100_000), max: Micros(60_000_000) },
        RequestError::Program { state: ProgramState::Running },
        RequestError::SettingRange(SETTING),
        RequestError::Correction(CorrectionFault::Underdetermined),
        RequestError::NotFitted { axis: Axis::Lens },
        RequestError::NoSuchRoutine,
        RequestError::NotInSession,
        RequestError::IdNotNew { last: 300 },
        RequestError::QueueFull { outstanding: 8 },
        RequestError::Period { min: Micros(15_500) },
        RequestError::Light { reason: LightFault::Exposure },
    ]
}

#[test]
fn responses_are_frozen() {
    lists_every_variant(&responses());
    let found: Vec<_> = responses().iter().map(|message| wire(Kind::Response, 1, message)).collect();
    check(
        &found,
        &[
            "040302010101050403020134030388ef99abc5e88c91110d6e75636c656f2d663432397a6905302e312e30756e697175652d69642d313203020101010101010580a7e92c1280f5b20cdac409904ef0e6174064c0843d1b80ecb80bdac409809eef2ba08d06808ece1c80084d086d4af60c00",
            "040302010101200403020101d285d8cc04018081c40586ffc305010109028081c40586ffc30501010bf90186ffc305010109010102011d01010c22c0843d01030302ac02040280a2020a010203ac0240a19e5100",
            "040302010101200403020101d285d8cc04018081c40586ffc305010109028081c40586ffc30501010bf90186ffc30501010901010201020115030302ac02040280a2020a010203ac02bbd807d900",
            "0403020101010a0403020102be9e4ff200",
            "0403020101010704030201034d060323d9d76000",
            "0403020101011004030201040c22c0843d08f1b152d100",
            "0403020101011a04030201050ba0f8fa0580b6dc05a09c0180dac4092dac315000",
            "040302010101180403020106030180e497d012c0843dac020201f2a99dcb00",
            "04030201010106040302010701036a4204402b4305928a9b4900",
            "04030201010106040302010701036a4205402b4301010103e1420104403f010103c03f05435f7dfc00",
            "04030201010106040302010701036a420a402b430101b88756a200",
            "04030201010106040302010701036a420a402b43010202d65f3b00",
            "04030201010106040302010701036a420a402b43010394e6584c00",
            "040302010101150403020108018005e003a2896f90d503829a5c2300",
            "0403020101011104030201090280808080040501b84f4100",
            "04030201010111040302010a02ffff03feff0324b69ef100",
        ],
    );
}

#[test]
fn errors_are_frozen() {
    lists_every_variant(&errors());
    let found: Vec<_> = errors().iter().map(|message| wire(Kind::Error, 1, message)).collect();
    check(
        &found,
        &[
            "0403030101010504030201070102a9151c4300",
            "0403030101010b0403020101048276e71300",
            "0403030101010a040302010280f58d1d00",
            "0403030101010a040302010316c58a6a00",
            "0403030101010604030201040582f5b20c0980f5b20ce06b7f4100",
            "04030301010106040302010501052f87c2b200",
            "0403030101010b0403020106086eac105500",
            "0403030101010b0403020107018b25d73500",
            "0403030101010c04030201080301297730e600",
            "0403030101010c04030201090515e56e72ab00",
            "0403030101010d040302010a0c074d8b52346f00",
            "04030301010106040302010b060c0ee6eab100",
            "04030301010106040302010c05d6cc24a100",
            "04030301010112040302010dfe9def2b809eef2b4d47cbbf00",
            "04030301010111040302010ea08d06808ece1cfe54c0c100",
            "0403030101010b040302010f0239fe076400",
            "0403030101011a04030201100ba0f8fa0580b6dc05a09c0180dac4094b7fd35400",
            "0403030101010b040302011104d364255900",
            "0403030101010b04030201120225926b9b00",
            "0403030101010a040302011372d53d7700",
            "0403030101010a0403020114d14059e900",
            "0403030101010c0403020115ac0296b6584200",
            "0403030101010b0403020116083fbed21f00",
            "0403030101010c04030201178c79eeee8f1300",
            "0403030101010b040302011802af7a846100",
        ],
    );
}
