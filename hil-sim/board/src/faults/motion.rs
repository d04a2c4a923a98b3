//! Motors, their drivers, their encoders, their switches and the emergency stop.

use super::{Kind, Takes};

/// Somebody presses the emergency stop, or its wire breaks.
pub const EMERGENCY_STOP: Kind = Kind {
    name: "emergency-stop",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_emergency_stop(true),
    mend: Some(|rig, _| rig.set_emergency_stop(false)),
};
/// The emergency stop is released.
pub const EMERGENCY_STOP_RELEASED: Kind = Kind {
    name: "emergency-stop-released",
    takes: Takes::NOTHING,
    happen: |rig, _| rig.set_emergency_stop(false),
    mend: None,
};
/// The motor's driver reports a fault.
pub const DRIVER_FAULT: Kind = Kind {
    name: "driver-fault",
    takes: Takes::STAGE,
    happen: |rig, at| rig.set_driver_fault(at.stage, true),
    mend: Some(|rig, at| rig.set_driver_fault(at.stage, false)),
};
/// The motor's driver takes it back.
pub const DRIVER_FINE: Kind = Kind {
    name: "driver-fine",
    takes: Takes::STAGE,
    happen: |rig, at| rig.set_driver_fault(at.stage, false),
    mend: None,
};
/// The driver's own supply dips: its sequencer begins anew at a whole period.
pub const DRIVER_RESETS: Kind = Kind {
    name: "driver-resets",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).reset_sequencer()),
    mend: None,
};
/// The motor is held fast.
pub const MOTOR_STALLS: Kind = Kind {
    name: "motor-stalls",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(true)),
    mend: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(false))),
};
/// The motor is free again.
pub const MOTOR_FREE: Kind = Kind {
    name: "motor-free",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(false)),
    mend: None,
};
/// The motor has only a part of its torque.
pub const MOTOR_WEAK: Kind = Kind {
    name: "motor-weak",
    takes: Takes::stage_and_amount(0.0, 1.0, 0.2),
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_torque(at.amount)),
    mend: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_torque(1.0))),
};
/// The encoder loses counts (or gains some) that its shaft has not made.
pub const ENCODER_SLIPS: Kind = Kind {
    name: "encoder-slips",
    takes: Takes::stage_and_amount(-4_000.0, 4_000.0, 100.0),
    happen: |rig, at| rig.slip_encoder(at.stage, at.amount as i64), // the range fits
    mend: None,
};
/// The encoder's wires are cut: what its shaft does meanwhile is not counted.
pub const ENCODER_DEAD: Kind = Kind {
    name: "encoder-dead",
    takes: Takes::STAGE,
    happen: |rig, at| rig.cut_encoder(at.stage, true),
    mend: Some(|rig, at| rig.cut_encoder(at.stage, false)),
};
/// The home switch says for ever that it is open (not actuated).
pub const HOME_SWITCH_DEAD: Kind = Kind {
    name: "home-switch-dead",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(Some(false))),
    mend: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(None))),
};
/// The home switch's wire breaks: it says that it is reached.
pub const HOME_SWITCH_BROKEN: Kind = Kind {
    name: "home-switch-broken",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(Some(true))),
    mend: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(None))),
};
/// The far switch's wire breaks: it says that it is reached.
pub const FAR_SWITCH_BROKEN: Kind = Kind {
    name: "far-switch-broken",
    takes: Takes::STAGE,
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_far(Some(true))),
    mend: Some(|rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_far(None))),
};
/// The motor's chopper is coupled into the switches' wires, so often a second.
pub const SWITCH_NOISE: Kind = Kind {
    name: "switch-noise",
    takes: Takes::stage_and_amount(0.0, 10_000.0, 200.0),
    happen: |rig, at| rig.set_switch_noise(at.stage, Some(at.amount)),
    mend: Some(|rig, at| rig.set_switch_noise(at.stage, None)),
};
