use farnear_capture::{
    describe::um,
    ready::{ensure_homed, steppers},
    sequence,
};
use farnear_protocol::{Nanometres, message::Axis};
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// Difference between the old and the new zero of each encoder.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct HomeFigures {
    /// Of stage A's stepper, which moves the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens_shift_um: Option<f64>,
}

#[derive(Clone, PartialEq, Debug)]
pub struct MoveSettings {
    pub rig: RigAddress,
    pub targets: Vec<(Axis, f64)>,
    /// Whether to home axes that are not homed.
    pub home: bool,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MovedAxis {
    pub axis: &'static str,
    pub asked_um: f64,
    pub measured_um: f64,
}

/// Positions reached. One axis is serialised as an object, several as a list.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum MoveFigures {
    One(MovedAxis),
    All { moved: Vec<MovedAxis> },
}

pub fn nanometres(name: &'static str, position_um: f64) -> Result<Nanometres> {
    sequence::nanometres(position_um).ok_or_else(|| {
        let expected = "expected a position of -2147483 to 2147483 um";
        WorkflowError::parameter(name, position_um, expected)
    })
}

/// Homes these axes simultaneously; without any, all that have a home switch.
pub fn home(rig: &RigAddress, axes: &[Axis], context: &Context<'_>) -> Result<HomeFigures> {
    let rig = Rig::connect(rig, None, context)?;
    let axes = if axes.is_empty() { steppers(&rig.client.hello().capabilities) } else { axes.to_vec() };
    let mut homed = HomeFigures::default();
    for (axis, work) in axes.iter().zip(rig.client.start_homing(&axes)?) {
        let shift = Some(um(work.homed()?));
        match axis {
            Axis::Lens => homed.lens_shift_um = shift,
            Axis::SensorCoarse | Axis::SensorFine => homed.shift_um = shift,
        }
    }
    Ok(homed)
}

pub fn move_to(settings: &MoveSettings, context: &Context<'_>) -> Result<MoveFigures> {
    let targets: Vec<_> = settings
        .targets
        .iter()
        .map(|(axis, to_um)| Ok((*axis, nanometres("to-um", *to_um)?)))
        .collect::<Result<_>>()?;
    let rig = Rig::connect(&settings.rig, None, context)?;
    if settings.home {
        ensure_homed(&rig.client, &mut |what| context.info(what))?;
    }
    let mut moved = Vec::new();
    for ((axis, _), work) in targets.iter().zip(rig.client.start_moves(&targets)?) {
        let end = work.moved()?;
        moved.push(MovedAxis { axis: axis.name(), asked_um: um(end.asked), measured_um: um(end.measured) });
    }
    Ok(match <[MovedAxis; 1]>::try_from(moved) {
        Ok([one]) => MoveFigures::One(one),
        Err(moved) => MoveFigures::All { moved },
    })
}

/// Stops all motion along the ramps and ends a running program; positions stay known.
pub fn stop(rig: &RigAddress, context: &Context<'_>) -> Result<()> {
    Ok(Rig::connect(rig, None, context)?.client.stop()?)
}

/// Emergency stop: moving axes lose their positions, and the alarm must be cleared.
pub fn halt(rig: &RigAddress, context: &Context<'_>) -> Result<()> {
    Ok(Rig::connect(rig, None, context)?.client.halt()?)
}
