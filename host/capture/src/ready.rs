//! Making the rig ready: every axis homed, and where that leaves the sensor.

use farnear_protocol::message::{Axis, Capabilities, PositionState, Status, StepperKeys};

use crate::client::Client;
use crate::describe::{axis_name, state_name};
use crate::error::ClientError;

/// The axes with a home switch that this rig has.
pub fn steppers(capabilities: &Capabilities) -> Vec<Axis> {
    let steppers = Axis::ALL.into_iter().filter(|axis| StepperKeys::of(*axis).is_some());
    steppers.filter(|axis| capabilities.has(*axis)).collect()
}

/// Homes what is not homed. One axis after the other: when a second request arrives while the first is under way
/// depends on this computer, and would make each run of an emulated rig another one.
///
/// # Errors
/// [`ClientError`].
pub fn ensure_homed(client: &Client, say: &mut dyn FnMut(&str)) -> Result<(), ClientError> {
    let status = client.status()?;
    for axis in steppers(&client.hello().capabilities) {
        let state = status.axis(axis).state;
        if state != PositionState::Homed {
            say(&format!("homing the {} (its position is {})", axis_name(axis), state_name(state)));
            client.home(axis)?;
        }
    }
    Ok(())
}

/// Sensor distance with both axes of stage A at 0, in nanometres: the datum and where the lens stage stands.
pub fn base_nm(client: &Client, status: &Status) -> i64 {
    i64::from(client.hello().limits.datum.0) + i64::from(status.lens.measured.0)
}

/// As [`base_nm`] after [`ensure_homed`], which brings a lens stage to 0 that was not homed.
pub fn base_when_homed_nm(client: &Client, status: &Status) -> i64 {
    match status.lens.state {
        PositionState::Homed => base_nm(client, status),
        PositionState::Unknown | PositionState::Lost => i64::from(client.hello().limits.datum.0),
    }
}
