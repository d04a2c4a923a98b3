//! Faults of motors, drivers, encoders, switches and the emergency stop.

use super::{Kind, Takes};

pub const EMERGENCY_STOP: Kind = Kind {
    name: "emergency-stop",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_emergency_stop(true),
    revert: Some(|rig, _| rig.set_emergency_stop(false)),
};
pub const EMERGENCY_STOP_RELEASED: Kind = Kind {
    name: "emergency-stop-released",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_emergency_stop(false),
    revert: None,
};
pub const DRIVER_FAULT: Kind = Kind {
    name: "driver-fault",
    takes: Takes::STAGE,
    happen: |rig, at| rig.set_driver_fault(at.stage, true),
    revert: Some(|rig, at| rig.set_driver_fault(at.stage, false)),
};
pub const DRIVER_FINE: Kind = Kind {
    name: "driver-fine",
    takes: Takes::STAGE,
    happen: |rig, at| rig.set_driver_fault(at.stage, false),
    revert: None,
};
/// The driver's supply dips: its sequencer restarts at a full period.
pub const DRIVER_RESETS: Kind = Kind {
    name: "driver-resets",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).reset_sequencer()),
    revert: None,
};
pub const MOTOR_STALLS: Kind = Kind {
    name: "motor-stalls",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(true)),
    revert: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(false))),
};
pub const MOTOR_FREE: Kind = Kind {
    name: "motor-free",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(false)),
    revert: None,
};
pub const MOTOR_WEAK: Kind = Kind {
    name: "motor-weak",
    takes: Takes::stage_and_amount(0.0, 1.0, 0.2),
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_torque(at.amount)),
    revert: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_torque(1.0))),
};
pub const ENCODER_SLIPS: Kind = Kind {
    name: "encoder-slips",
    takes: Takes::stage_and_amount(-4_000.0, 4_000.0, 100.0),
    happen: |rig, at| rig.slip_encoder(at.stage, at.amount as i64), // the range fits
    revert: None,
};
/// Encoder wires cut: motion meanwhile is not counted.
pub const ENCODER_DEAD: Kind = Kind {
    name: "encoder-dead",
    takes: Takes::STAGE,
    happen: |rig, at| rig.cut_encoder(at.stage, true),
    revert: Some(|rig, at| rig.cut_encoder(at.stage, false)),
};
/// Home switch stuck open (not actuated).
pub const HOME_SWITCH_DEAD: Kind = Kind {
    name: "home-switch-dead",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(Some(false))),
    revert: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(None))),
};
/// Home switch wire broken: reads actuated.
pub const HOME_SWITCH_BROKEN: Kind = Kind {
    name: "home-switch-broken",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(Some(true))),
    revert: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(None))),
};
pub const FAR_SWITCH_BROKEN: Kind = Kind {
    name: "far-switch-broken",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_far(Some(true))),
    revert: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_far(None))),
};
pub const SWITCH_NOISE: Kind = Kind {
    name: "switch-noise",
    takes: Takes::stage_and_amount(0.0, 10_000.0, 200.0),
    happen: |rig, at| rig.set_switch_noise(at.stage, Some(at.amount)),
    revert: Some(|rig, at| rig.set_switch_noise(at.stage, None)),
};
