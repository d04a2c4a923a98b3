//! The largest form of every message fits a frame.

use farnear_protocol::{
    BoardMicros, Call, Event, EventKind, LOG_BYTES_MAX, Log, Micros, Nanometres, Request, Response,
    frame::{BODY_MAX, FRAME_MAX, Header, Kind, encode},
    message::*,
};
use serde::Serialize;

use super::{
    answers::{hello, status},
    parts::CORRECTION,
};

const NM: Nanometres = Nanometres(i32::MIN);
const US: Micros = Micros(u32::MAX);
const TIME: BoardMicros = BoardMicros(u64::MAX);

/// Frame length with all numbers at their longest.
#[track_caller]
fn length<T: Serialize>(kind: Kind, message: &T) -> usize {
    let header = Header { version: 255, kind, id: u32::MAX, boot: u32::MAX };
    let frame = encode(header, message).expect("it fits a frame");
    assert!(frame.len() <= FRAME_MAX);
    frame.len()
}

#[track_caller]
fn asked_length(request: Request) -> usize {
    length(Kind::Request, &Call { session: u32::MAX, request })
}

#[test]
fn rows_and_coefficients_fill_but_never_exceed_a_frame() {
    let codes = Codes::from_slice(&[i16::MIN; CODES_MAX]).expect("that many");
    let bits = CoefficientBits::from_slice(&[i32::MIN; COEFFICIENTS_MAX]).expect("that many");
    let (row, first, step, truth) = (u16::MAX, u16::MAX, u16::MAX, i16::MIN);
    let samples = asked_length(Request::FitSamples { row, first, step, truth, codes: codes.clone() });
    // One more code could exceed the frame.
    assert!(samples + 3 > BODY_MAX, "{samples}: the message could take more codes");
    asked_length(Request::PutRow { first, codes: codes.clone() });
    asked_length(Request::PutCoefficients { first: 255, bits: bits.clone() });
    length(Kind::Response, &Response::Row(codes));
    length(Kind::Response, &Response::Coefficients(bits));
    let bytes = heapless::Vec::from_slice(&[0xff; LOG_BYTES_MAX]).expect("that many");
    length(Kind::Log, &Log { bytes });
}

#[test]
fn the_longest_answers_fit() {
    let axis = AxisStatus {
        state: PositionState::Lost,
        asked: NM,
        measured: NM,
        moving: true,
        request: Some(u32::MAX),
    };
    let alarm = AlarmRecord {
        number: u32::MAX,
        boot: u32::MAX,
        time: TIME,
        alarm: Alarm::Following { axis: Axis::Lens, error: NM },
    };
    let program = ProgramStatus { state: ProgramState::Paused, shots: 255, index: 255, exposures: u16::MAX };
    length(
        Kind::Response,
        &Response::Status(Status {
            time: TIME,
            coarse: axis,
            fine: axis,
            lens: axis,
            alarm: Some(alarm),
            program,
            next_event: u32::MAX,
            triggers: u32::MAX,
            steps: u64::MAX,
            link: LinkCounters {
                frames: u32::MAX,
                bad_frames: u32::MAX,
                repeated: u32::MAX,
                stale: u32::MAX,
                overflowed: u32::MAX,
            },
            ..status()
        }),
    );
    let name = || "a name of 24 characters.".try_into().expect("just fits");
    let limits = Limits {
        datum: NM,
        coarse_min: NM,
        coarse_max: NM,
        coarse_step_pm: u32::MAX,
        fine_min: NM,
        fine_max: NM,
        shots_max: 255,
        exposure_min: US,
        exposure_max: US,
        lens_min: NM,
        lens_max: NM,
        lens_step_pm: u32::MAX,
        distance_min: NM,
        silence_min: US,
        silence_max: US,
        row_pixels_max: u16::MAX,
    };
    length(
        Kind::Response,
        &Response::Hello(Hello {
            schema_key: u64::MAX,
            board: name(),
            firmware: name(),
            boot: u32::MAX,
            limits,
            last_id: u32::MAX,
            outstanding: u8::MAX,
            ..hello()
        }),
    );
    let counters = Counters {
        boots: u32::MAX,
        alarms: u32::MAX,
        triggers: u64::MAX,
        coarse_steps: u64::MAX,
        lens_steps: u64::MAX,
        homings: u32::MAX,
        repaired: u32::MAX,
    };
    length(Kind::Response, &Response::Counters(counters));
    length(Kind::Event, &Event { time: TIME, kind: EventKind::Alarm(alarm) });
}

#[test]
fn an_event_fits_an_answer_too() {
    let shot = ShotRecord {
        index: 255,
        repeat: u16::MAX,
        trigger_number: u32::MAX,
        axis: Axis::Lens,
        asked: NM,
        coarse: NM,
        fine: NM,
        lens: NM,
        settle: US,
        trigger: TIME,
        strobe_start: TIME,
        strobe_end: TIME,
        exposure: US,
    };
    let event = Event { time: TIME, kind: EventKind::ShotDone { request: u32::MAX, shot } };
    length(Kind::Response, &Response::Event(event));
    let kind = EventKind::FrameTaken { request: u32::MAX, frame: u32::MAX, deviation: NM, shot };
    length(Kind::Response, &Response::Event(Event { time: TIME, kind }));
}

#[test]
fn the_longest_requests_fit() {
    let deviations = QueryDeviations {
        day_e3: u32::MAX,
        time_s: u32::MAX,
        latitude_e7: u32::MAX,
        longitude_e7: u32::MAX,
        azimuth_e7: u32::MAX,
        camera_height_mm: u32::MAX,
        height_mm: u32::MAX,
        distance_mm: u32::MAX,
    };
    let shadow = ShadowQuery {
        azimuth_e7: i32::MIN,
        camera_height_mm: u32::MAX,
        distance_mm: u32::MAX,
        lateral_mm: i32::MIN,
        height_mm: u32::MAX,
        deviations,
    };
    let sun = SunQuery {
        unix_seconds: i64::MIN,
        latitude_e7: i32::MIN,
        longitude_e7: i32::MIN,
        shadow: Some(shadow),
    };
    asked_length(Request::Sun(sun));
    let correction = CorrectionInfo {
        width: u16::MAX,
        height: u16::MAX,
        centre_um: i32::MIN,
        half_span_um: i32::MIN,
        ..CORRECTION
    };
    asked_length(Request::OpenCorrection(correction));
    let shot = Shot {
        axis: Axis::Lens,
        target: NM,
        exposure: US,
        settle_window: NM,
        settle_dwell: US,
        repeat: u16::MAX,
        mode: TriggerMode::FreeRunning,
    };
    asked_length(Request::LoadShot { index: 255, shot });
}
