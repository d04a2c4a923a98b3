use farnear_protocol::{
    Nanometres,
    message::{Axis, Capabilities, PositionState, Status, sensor_distance_nm},
};

use crate::{
    client::Client,
    describe::{axis_name, state_name},
    error::ClientError,
};

pub fn steppers(capabilities: &Capabilities) -> Vec<Axis> {
    [Axis::SensorCoarse, Axis::Lens].into_iter().filter(|axis| capabilities.has(*axis)).collect()
}

/// Homes all unhomed axes simultaneously.
pub fn ensure_homed(client: &Client, say: &mut dyn FnMut(&str)) -> Result<(), ClientError> {
    let status = client.status()?;
    let mut axes = steppers(&client.hello().capabilities);
    axes.retain(|axis| status.axis(*axis).state != PositionState::Homed);
    for axis in &axes {
        let state = state_name(status.axis(*axis).state);
        say(&format!("homing the {} (its position is {state})", axis_name(*axis)));
    }
    for work in client.start_homing(&axes)? {
        work.homed()?;
    }
    Ok(())
}

/// Sensor distance with stage A at 0: datum plus lens position, nm.
pub fn base_nm(client: &Client, status: &Status) -> i64 {
    base(client, |axis| status.axis(axis).measured)
}

/// As [`base_nm`] after [`ensure_homed`], which moves an unhomed lens stage to 0.
pub fn base_when_homed_nm(client: &Client, status: &Status) -> i64 {
    base(client, |axis| match status.axis(axis).state {
        PositionState::Homed => status.axis(axis).measured,
        PositionState::Unknown | PositionState::Lost => Nanometres(0),
    })
}

fn base(client: &Client, position: impl Fn(Axis) -> Nanometres) -> i64 {
    sensor_distance_nm(client.hello().limits.datum, |axis| match axis {
        Axis::SensorCoarse | Axis::SensorFine => Nanometres(0),
        Axis::Lens => position(axis),
    })
}
