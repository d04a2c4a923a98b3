//! The protocol's enums in words.

mod alarm;
mod refusal;

use farnear_protocol::{
    message::{Axis, DropReason, PositionState, ProgramState, RecordName, ResetCause, Routine, TriggerMode},
    units::Nanometres,
};

pub use alarm::{alarm_text, failure_text};
pub use refusal::refusal_text;

/// Remedies for a camera that is slower than the board expects.
const SLOW_READOUT: &str = "if the first exposure succeeds and later ones fail, the camera reads out for longer than \
                            camera_readout_us: `farnear rig settings set camera_readout_us ...`; a trigger delay must be shorter \
                            than strobe_deadline_us";

pub fn um(position: Nanometres) -> f64 {
    f64::from(position.0) / 1000.0
}

pub fn axis_name(axis: Axis) -> &'static str {
    match axis {
        Axis::SensorCoarse => "sensor's coarse axis",
        Axis::SensorFine => "sensor's piezo",
        Axis::Lens => "lens stage",
    }
}

pub fn state_name(state: PositionState) -> &'static str {
    match state {
        PositionState::Unknown => "unknown",
        PositionState::Homed => "homed",
        PositionState::Lost => "lost",
    }
}

pub fn program_name(state: ProgramState) -> &'static str {
    match state {
        ProgramState::Idle => "not armed",
        ProgramState::Armed => "armed",
        ProgramState::Running => "running",
        ProgramState::Paused => "paused",
    }
}

pub fn trigger_name(mode: TriggerMode) -> &'static str {
    match mode {
        TriggerMode::Hardware => "hardware",
        TriggerMode::Software => "software",
        TriggerMode::FreeRunning => "free-running",
    }
}

pub fn drop_text(reason: DropReason) -> String {
    match reason {
        DropReason::NotSettled { error } => format!("not settled, {:.3} um off", um(error)),
        DropReason::CameraBusy => "the camera was not ready".into(),
        DropReason::NoStrobe => {
            format!("the camera's exposure signal did not come or was too short; {SLOW_READOUT}")
        }
    }
}

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

pub fn record_name(record: RecordName) -> &'static str {
    match record {
        RecordName::Settings => "settings",
        RecordName::Counters => "counters",
        RecordName::Alarms => "alarms",
        RecordName::Program => "exposure program",
        RecordName::Correction => "depth correction",
    }
}

pub fn routine_name(routine: Routine) -> String {
    match routine {
        Routine::Travel { axis } => format!("travel of the {}", axis_name(axis)),
        Routine::Backlash { axis } => format!("backlash of the {}", axis_name(axis)),
        Routine::Piezo => "piezo's gain, hysteresis and creep".into(),
        Routine::Gauge => "strain gauge's gain and zero".into(),
    }
}
