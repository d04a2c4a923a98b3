//! Making the rig ready: every axis homed, and where that leaves the sensor.

use farnear_protocol::message::{Axis, AxisStatus, Capabilities, PositionState, Status};

use crate::{
    client::Client,
    describe::{axis_name, state_name},
    error::ClientError,
};

/// The axes with a home switch that this rig has.
pub fn steppers(capabilities: &Capabilities) -> Vec<Axis> {
    let fitted = [(Axis::SensorCoarse, capabilities.sensor_coarse), (Axis::Lens, capabilities.lens)];
    fitted.into_iter().filter_map(|(axis, fitted)| fitted.then_some(axis)).collect()
}

/// How an axis is.
pub fn axis_status(status: &Status, axis: Axis) -> &AxisStatus {
    match axis {
        Axis::SensorCoarse => &status.coarse,
        Axis::SensorFine => &status.fine,
        Axis::Lens => &status.lens,
    }
}

/// Homes what is not homed. One axis after the other: when a second request arrives while the first is under way
/// depends on this computer, and would make each run of an emulated rig another one.
///
/// # Errors
/// [`ClientError`].
pub fn ensure_homed(client: &Client, say: &mut dyn FnMut(&str)) -> Result<(), ClientError> {
    let status = client.status()?;
    for axis in steppers(&client.hello().capabilities) {
        let state = axis_status(&status, axis).state;
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
