//! The protocol's enums in words, for errors and for people.

use farnear_protocol::message::{Axis, Failure, PositionState, RequestError, ResetCause, ShotFault};
use farnear_protocol::units::Nanometres;

/// A position in micrometres, the unit people read.
pub fn um(position: Nanometres) -> f64 {
    f64::from(position.0) / 1000.0
}

/// Name of an axis.
pub fn axis_name(axis: Axis) -> &'static str {
    match axis {
        Axis::SensorCoarse => "sensor's coarse axis",
        Axis::SensorFine => "sensor's piezo",
    }
}

/// What is known of a position.
pub fn state_name(state: PositionState) -> &'static str {
    match state {
        PositionState::Unknown => "unknown",
        PositionState::Homed => "homed",
        PositionState::Lost => "lost",
    }
}

/// Why a board was reset.
pub fn cause_name(cause: ResetCause) -> &'static str {
    match cause {
        ResetCause::PowerOn => "power on",
        ResetCause::Pin => "reset pin",
        ResetCause::Software => "software",
        ResetCause::Watchdog => "watchdog",
        ResetCause::BrownOut => "brown-out",
        ResetCause::LowPower => "low power",
        ResetCause::Unknown => "unknown",
    }
}

/// Why the board refused.
pub fn refusal_text(error: &RequestError) -> String {
    match error {
        RequestError::Version { min, current } => format!("it speaks protocol {min} to {current}"),
        RequestError::Boot { current } => {
            format!("the request was made for another boot; this one is {current}")
        }
        RequestError::Malformed => "it did not understand the request".into(),
        RequestError::IdReused => {
            "the request's id was already used: does another program talk to the board?".into()
        }
        RequestError::OutOfRange { axis, asked, min, max } => format!(
            "{:.3} um is outside the limits of the {}, {:.3} to {:.3} um",
            um(*asked),
            axis_name(*axis),
            um(*min),
            um(*max)
        ),
        RequestError::NotHomed { axis, state } => {
            format!("the position of the {} is {}; home it first", axis_name(*axis), state_name(*state))
        }
        RequestError::Busy { request } => {
            format!(
                "it is still busy with request {request}; wait for its end or stop it (`farnear rig stop`)"
            )
        }
        RequestError::CannotHome { axis } => {
            format!("the {} has no home switch and needs no homing", axis_name(*axis))
        }
        RequestError::Shot { index, reason } => format!("shot {index}: {}", shot_fault_text(*reason)),
        RequestError::EventGone { oldest, next } => {
            format!("it remembers the events from {oldest} to just before {next} only")
        }
    }
}

fn shot_fault_text(fault: ShotFault) -> &'static str {
    match fault {
        ShotFault::Index => "there is no such place in the program",
        ShotFault::Missing => "it was never loaded",
        ShotFault::Exposure => "the exposure time is outside the board's limits",
        ShotFault::Settle => "the settle window or its time is not possible",
        ShotFault::Repeat => "the repeat count is 0",
    }
}

/// Why long work ended early, with what to do.
pub fn failure_text(reason: Failure) -> String {
    match reason {
        Failure::Stopped => "it was stopped".into(),
        Failure::HomeSwitchNotFound => {
            "the home switch did not close within the whole travel; check the switch, its cable and that the stage moves".into()
        }
        Failure::HomeSwitchStuck => "the home switch did not open again; check the switch and its cable".into(),
        Failure::FarSwitch => "the far switch closed; the stage ran past its travel, home it again".into(),
        Failure::HomeSwitch => "the home switch closed where it should not; home again".into(),
        Failure::Following { error } => format!(
            "encoder and steps disagree by {:.3} um (stall or slip); free the stage and home it again",
            um(error)
        ),
        Failure::NotSettled { error } => {
            format!("it did not settle in time ({:.3} um off at the end); is something shaking the rig?", um(error))
        }
        Failure::NoStrobe => "the camera's exposure signal did not come; is the camera armed and its cable in?".into(),
        Failure::DriverFault => "the motor driver reports a fault; check its supply and temperature".into(),
        Failure::StepUnderrun => "the step timer ran dry; home again, and report this as a bug".into(),
        Failure::Gauge => "the piezo's strain gauge gives nonsense; check its cable".into(),
    }
}
