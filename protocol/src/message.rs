//! The message tables: [`Request`]; [`Response`] and [`RequestError`]; [`EventKind`]. Parts are in a file per subject.
//!
//! Positions are [`Nanometres`], positive = sensor and lens apart (towards near focus), 0 = home switch; sensor
//! distance = datum + coarse + fine + lens ([`sensor_distance_nm`]). Set-points are absolute, so a repeated request has
//! no new effect. Times are [`BoardMicros`], durations [`Micros`]. Variants and messages may be appended; any other
//! change is a new protocol version. `tests/it/frozen_wire` freezes the bytes of version 3.
//!
//! [`BoardMicros`]: crate::BoardMicros
//! [`Micros`]: crate::Micros
//! [`Nanometres`]: crate::Nanometres

mod alarm;
mod answer;
mod axis;
mod board;
mod calibration;
mod call;
mod event;
mod light;
mod link;
mod maths;
mod memory;
mod request;
mod shot;

use postcard_schema::key::Key;

pub use self::{
    alarm::{Alarm, AlarmRecord},
    answer::{RequestError, Response},
    axis::{Axis, AxisStatus, PositionState, sensor_distance_nm},
    board::{Capabilities, Hello, Limits, LinkCounters, ResetCause, Status},
    calibration::{Calibration, Routine},
    call::{Call, ID_STEP_MAX, NO_SESSION},
    event::{Event, EventKind, Failure},
    light::{LIGHT_LEVEL_MAX, LIGHT_TIME_MAX, LightFault, LightLevels, ShotLight},
    link::{LINK_TRIAL, LinkRate},
    maths::{
        CODES_MAX, COEFFICIENTS_MAX, Codes, CoefficientBits, CorrectionFault, CorrectionForm, CorrectionInfo,
        QueryDeviations, ShadowAnswer, ShadowQuery, ShadowReliability, SunAnswer, SunQuery,
    },
    memory::{Counters, RecordName, Setting, SettingKey, StepperKeys},
    request::Request,
    shot::{
        DropReason, ProgramState, ProgramStatus, Shot, ShotFault, ShotRecord, TriggerMode, strobe_tolerance,
    },
};

/// Key of all message tables: equal keys mean equal bytes for every message.
pub const SCHEMA_KEY: u64 = {
    let keys = [
        Key::for_path::<Request>("request").to_bytes(),
        Key::for_path::<Response>("response").to_bytes(),
        Key::for_path::<RequestError>("error").to_bytes(),
        Key::for_path::<Event>("event").to_bytes(),
    ];
    let mut sum = 0u64;
    let mut i = 0;
    while i < keys.len() {
        sum = sum.rotate_left(17) ^ u64::from_le_bytes(keys[i]);
        i += 1;
    }
    sum
};
