//! Motors, their drivers, their switches and the emergency stop.

use super::Kind;

/// Somebody presses the emergency stop, or its wire breaks.
pub const EMERGENCY_STOP: Kind =
    Kind { name: "emergency-stop", happen: |rig, _| rig.set_emergency_stop(true) };
/// The emergency stop is released.
pub const EMERGENCY_STOP_RELEASED: Kind =
    Kind { name: "emergency-stop-released", happen: |rig, _| rig.set_emergency_stop(false) };
/// The motor's driver reports a fault.
pub const DRIVER_FAULT: Kind =
    Kind { name: "driver-fault", happen: |rig, at| rig.set_driver_fault(at.stage, true) };
/// The motor's driver takes it back.
pub const DRIVER_FINE: Kind =
    Kind { name: "driver-fine", happen: |rig, at| rig.set_driver_fault(at.stage, false) };
/// The motor is held fast.
pub const MOTOR_STALLS: Kind = Kind {
    name: "motor-stalls",
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(true)),
};
/// The motor is free again.
pub const MOTOR_FREE: Kind = Kind {
    name: "motor-free",
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stalled(false)),
};
/// The home switch says for ever that it is open (not actuated).
pub const HOME_SWITCH_DEAD: Kind = Kind {
    name: "home-switch-dead",
    happen: |rig, at| rig.plant(|plant| plant.stage_mut(at.stage).set_stuck_home(Some(false))),
};
