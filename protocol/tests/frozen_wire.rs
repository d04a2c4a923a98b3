//! The bytes of protocol version 1.
//!
//! Do not change an expectation here: a message whose bytes differ is another protocol, so either the change is
//! a mistake or `PROTOCOL_CURRENT` grows and a new file freezes the new version. Messages may be appended.
//! The first frame was also put together by hand from `docs/protocol.md` (see `by_hand`), with the CRC from an
//! independent calculation (Python's `zlib.crc32`).

use farnear_protocol::{
    BoardMicros, Event, EventKind, Micros, Nanometres, Request, RequestError, Response,
    camera::{Control, FrameHeader},
    frame::{Header, Kind, encode},
    message::*,
};
use serde::Serialize;

fn wire<T: Serialize>(kind: Kind, id: u32, message: &T) -> String {
    let header = Header { version: 1, kind, id, boot: 0x0102_0304 };
    encode(header, message).expect("fits").iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn by_hand() {
    // version 1, kind 1, id 5, boot 0x01020304, body 03 00 02 (Move, SensorCoarse, zigzag varint of 1),
    // CRC-32/ISO-HDLC of these = 0x64ffc2e7 (zlib.crc32), little-endian; then COBS and the delimiter.
    let message = Request::Move { axis: Axis::SensorCoarse, target: Nanometres(1) };
    assert_eq!(wire(Kind::Request, 5, &message), BY_HAND);
}

const BY_HAND: &str = "0401010501010604030201030602e7c2ff6400";

#[test]
fn the_schema_key_changes_only_with_the_table() {
    assert_eq!(format!("{SCHEMA_KEY:016x}"), "a5f8c1b2d8b56e50");
}

#[test]
fn requests() {
    let shot = Shot {
        axis: Axis::SensorFine,
        target: Nanometres(178_136),
        exposure: Micros(5_000),
        settle_window: Nanometres(50),
        settle_dwell: Micros(1_000),
        repeat: 2,
    };
    let table = [
        Request::Hello,
        Request::Status,
        Request::Home { axis: Axis::SensorCoarse },
        Request::Move { axis: Axis::SensorFine, target: Nanometres(-1) },
        Request::Stop,
        Request::LoadShot { index: 1, shot },
        Request::RunProgram { shots: 2 },
        Request::ReadEvent { number: 300 },
        Request::Reboot,
    ];
    check(
        &table.map(|message| wire(Kind::Request, 0x0A0B_0C0D, &message)),
        &[
            "0b01010d0c0b0a0403020105976c1dbd00",
            "1001010d0c0b0a0403020101015c1aca00",
            "0c01010d0c0b0a0403020102058496e28e00",
            "1201010d0c0b0a04030201030101c221875700",
            "1001010d0c0b0a04030201048ea870ba00",
            "1b01010d0c0b0a04030201050101b0df15882764e807023970a46700",
            "1101010d0c0b0a040302010602ac32800400",
            "0e01010d0c0b0a0403020107ac02041a2ed200",
            "1001010d0c0b0a0403020108a5e4c6b300",
        ],
    );
}

#[test]
fn responses() {
    let axis = AxisStatus {
        state: PositionState::Homed,
        asked: Nanometres(5_800_000),
        measured: Nanometres(5_799_875),
        moving: true,
    };
    let table = [
        Response::Hello(Hello {
            protocol_min: 1,
            protocol_current: 1,
            schema_key: 0x1122_3344_5566_7788,
            board: "nucleo-f429zi".try_into().expect("fits"),
            firmware: "0.1.0".try_into().expect("fits"),
            unique_id: *b"unique-id-12",
            boot: 3,
            reset_cause: ResetCause::Software,
            emulated: true,
            capabilities: Capabilities { sensor_coarse: true, sensor_fine: true, strobe: true },
            limits: Limits {
                datum: Nanometres(47_000_000),
                coarse_min: Nanometres(0),
                coarse_max: Nanometres(13_000_000),
                coarse_step_pm: 156_250,
                fine_min: Nanometres(0),
                fine_max: Nanometres(200_000),
                shots_max: 64,
                exposure_min: Micros(100),
                exposure_max: Micros(1_000_000),
            },
        }),
        Response::Status(Status {
            time: BoardMicros(1_234_567_890),
            coarse: axis,
            fine: AxisStatus { state: PositionState::Lost, moving: false, ..axis },
            home_switch: true,
            far_switch: false,
            active: Some(9),
            next_event: 4,
            triggers: 2,
            steps: 37_120,
            link: LinkCounters { frames: 10, bad_frames: 1, repeated: 2 },
        }),
        Response::Accepted,
        Response::Event(Event {
            time: BoardMicros(77),
            kind: EventKind::Started { cause: ResetCause::Watchdog },
        }),
    ];
    check(
        &table.map(|message| wire(Kind::Response, 1, &message)),
        &[
            "040102010101050403020136010188ef99abc5e88c91110d6e75636c656f2d663432397a6905302e312e30756e697175652d69642d313203020101010180a7e92c0880f5b20cdac4090d80b5184064c0843dd4056fbe00",
            "0401020101011e0403020101d285d8cc04018081c40586ffc30501028081c40586ffc30502010f0109040280a2020a0102338ef32e00",
            "0401020101010a04030201027f2723aa00",
            "0401020101010704030201034d06038e1db98100",
        ],
    );
}

#[test]
fn errors() {
    let table = [
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
    ];
    check(
        &table.map(|message| wire(Kind::Error, 1, &message)),
        &[
            "0401030101010504030201070102e2a0402300",
            "0401030101010b0403020101041de8dcff00",
            "0401030101010a0403020102414ce14500",
            "0401030101010a0403020103d77ce63200",
            "0401030101010604030201040582f5b20c0980f5b20c9d6abba500",
            "040103010101060403020105010564329ed200",
            "0401030101010b040302010608f1322bb900",
            "0401030101010b04030201070114bbecd900",
            "0401030101010c0403020108030162c26c8600",
            "0401030101010c04030201090515aedb2ecb00",
        ],
    );
}

#[test]
fn events() {
    let record = ShotRecord {
        index: 1,
        repeat: 0,
        trigger_number: 2,
        axis: Axis::SensorFine,
        asked: Nanometres(178_136),
        coarse: Nanometres(5_809_375),
        fine: Nanometres(178_140),
        settle: Micros(12_400),
        trigger: BoardMicros(2_000_000),
        strobe_start: BoardMicros(2_000_020),
        strobe_end: BoardMicros(2_005_020),
        exposure: Micros(5_000),
    };
    let failure = |reason| EventKind::Failed { request: 6, axis: Some(Axis::SensorCoarse), reason };
    let table = [
        EventKind::Started { cause: ResetCause::BrownOut },
        EventKind::Homed { request: 2, axis: Axis::SensorCoarse, shift: Nanometres(-125) },
        EventKind::MoveDone {
            request: 3,
            axis: Axis::SensorCoarse,
            asked: Nanometres(5_800_000),
            measured: Nanometres(5_800_125),
        },
        EventKind::ShotDone { request: 4, shot: record },
        EventKind::ProgramDone { request: 4, exposures: 2 },
        EventKind::Failed { request: 5, axis: None, reason: Failure::Stopped },
        failure(Failure::HomeSwitchNotFound),
        failure(Failure::HomeSwitchStuck),
        failure(Failure::FarSwitch),
        failure(Failure::HomeSwitch),
        failure(Failure::Following { error: Nanometres(-4_000) }),
        failure(Failure::NotSettled { error: Nanometres(120) }),
        failure(Failure::NoStrobe),
        failure(Failure::DriverFault),
        failure(Failure::StepUnderrun),
        failure(Failure::Gauge),
    ];
    let event = |kind| wire(Kind::Event, 7, &Event { time: BoardMicros(1_000_000), kind });
    check(
        &table.map(event),
        &[
            "0401040701010804030201c0843d060442bea72500",
            "0401040701010a04030201c0843d010207f901ea29d91400",
            "0401040701010a04030201c0843d02030d8081c405fa82c405c148995100",
            "0401040701010b04030201c0843d0304011e0201b0df15be93c505b8df15f06080897a94897a9cb07a88277c16127700",
            "0401040701010f04030201c0843d0404027fa1f2a300",
            "0401040701010a04030201c0843d05050105511e539900",
            "0401040701010b04030201c0843d0506010601be2887aa00",
            "0401040701010b04030201c0843d050601060204798e3300",
            "0401040701010b04030201c0843d05060106039249894400",
            "0401040701010b04030201c0843d050601060431dcedda00",
            "0401040701010b04030201c0843d0506010805bf3eb4941fab00",
            "0401040701010b04030201c0843d0506010806f0011a54de6800",
            "0401040701010b04030201c0843d05060106078b8de44300",
            "0401040701010b04030201c0843d05060106081a905bd300",
            "0401040701010b04030201c0843d05060106098ca05ca400",
            "0401040701010b04030201c0843d050601060a36f1553d00",
        ],
    );
}

#[test]
fn camera_endpoint() {
    let header =
        FrameHeader { shot_id: 2, exposure: BoardMicros(2_000_020), width: 640, height: 480, bits: 8 };
    assert_eq!(header.length(), 17 + 2 * 640 * 480);
    assert_eq!(header.to_bytes(), [2, 0, 0, 0, 0x94, 0x84, 0x1e, 0, 0, 0, 0, 0, 0x80, 2, 0xe0, 1, 8]);
    assert_eq!(FrameHeader::from_bytes(&header.to_bytes()), Some(header));
    let mut buffer = [0; 16];
    let control = postcard::to_slice(&Control::AdvanceMicros(300), &mut buffer).expect("fits");
    assert_eq!(control, [0, 0xac, 2]);
}

fn check(found: &[String], frozen: &[&str]) {
    for (index, (found, frozen)) in found.iter().zip(frozen).enumerate() {
        assert_eq!(found, frozen, "message {index}");
    }
    assert_eq!(found.len(), frozen.len(), "freeze these:\n\"{}\",", found.join("\",\n\""));
}
