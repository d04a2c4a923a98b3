use farnear_capture::{
    Client,
    describe::um,
    expose::{CaptureError, check_position},
    ready::{ensure_homed, steppers},
    sequence,
};
use farnear_protocol::{Nanometres, message::Axis};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AxisName, Rig, RigAddress};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
};

/// Find the home switches and make them position 0: of all stages at once, or of those that are named.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear rig home --port /dev/ttyACM0 --axis lens")
)]
#[serde(default)]
pub struct HomeRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    /// The axis to home; may be given again [default: all that have a home switch].
    #[cfg_attr(feature = "clap", arg(long, value_name = "AXIS"))]
    pub axis: Vec<AxisName>,
}

impl Request for HomeRequest {
    const NAME: &'static str = "rig home";
    const REQUIRED: &'static [&'static str] = &[];
    const PATHS: &'static [(&'static str, PathKind)] = &[];
    type Figures = HomeFigures;

    fn check(&self) -> Result<()> {
        each_once(&self.axis)
    }

    fn run(&self, context: &Context<'_>) -> Result<HomeFigures> {
        home(self, context)
    }
}

crate::request::rig_request!(HomeRequest);

/// Difference between the old and the new zero of each encoder.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct HomeFigures {
    /// Of stage A's stepper, which moves the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens_shift_um: Option<f64>,
}

/// Move to absolute positions, several axes at once; outside the limits it is refused.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig move --port /dev/ttyACM0 --axis coarse --to-um 5800 --axis lens --to-um 1000"
    )
)]
#[serde(default)]
pub struct MoveRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    /// The axis; may be given again, each with its position.
    #[cfg_attr(feature = "clap", arg(long, value_name = "AXIS", required = true))]
    pub axis: Vec<AxisName>,
    /// The position in micrometres, positive = sensor and lens away from each other; 0 = home switch. The piezo moves within fine_min_nm and fine_max_nm; `farnear rig reset` relaxes it.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM", required = true))]
    pub to_um: Vec<f64>,
    /// Home axes first that are not homed.
    #[cfg_attr(feature = "clap", arg(long))]
    pub home: bool,
}

impl Request for MoveRequest {
    const NAME: &'static str = "rig move";
    const REQUIRED: &'static [&'static str] = &["axis", "to_um"];
    const PATHS: &'static [(&'static str, PathKind)] = &[];
    type Figures = MoveFigures;

    fn check(&self) -> Result<()> {
        self.targets().map(drop)
    }

    fn run(&self, context: &Context<'_>) -> Result<MoveFigures> {
        move_to(self, context)
    }
}

crate::request::rig_request!(MoveRequest);

impl MoveRequest {
    fn targets(&self) -> Result<Vec<(Axis, Nanometres)>> {
        let axes = self.axis.len();
        if axes != self.to_um.len() || axes == 0 {
            let given: Vec<String> = self.to_um.iter().map(f64::to_string).collect();
            let expected = format!("expected {axes} positions, one for each axis");
            return Err(WorkflowError::parameter("to-um", given.join(", "), expected));
        }
        each_once(&self.axis)?;
        let pairs = self.axis.iter().zip(&self.to_um);
        pairs.map(|(axis, to_um)| Ok((Axis::from(*axis), nanometres("to-um", *to_um)?))).collect()
    }
}

fn each_once(axes: &[AxisName]) -> Result<()> {
    let twice = (1..axes.len()).find(|at| axes[..*at].contains(&axes[*at]));
    twice.map_or(Ok(()), |at| {
        let expected = "expected each axis once";
        Err(WorkflowError::parameter("axis", Axis::from(axes[at]).name(), expected))
    })
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

/// Homes the axes simultaneously.
pub fn home(request: &HomeRequest, context: &Context<'_>) -> Result<HomeFigures> {
    request.check()?;
    let rig = Rig::connect(&request.rig, None, context)?;
    let axes = match &request.axis[..] {
        [] => steppers(&rig.client.hello().capabilities),
        named => named.iter().map(|axis| Axis::from(*axis)).collect(),
    };
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

pub fn move_to(request: &MoveRequest, context: &Context<'_>) -> Result<MoveFigures> {
    let targets = request.targets()?;
    let rig = Rig::connect(&request.rig, None, context)?;
    for (axis, target) in &targets {
        check_position(&rig.client, *axis, *target).map_err(CaptureError::from)?;
    }
    if request.home {
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
    Ok(connect_to_stop(rig, context)?.client.stop()?)
}

/// Emergency stop: moving axes lose their positions, and the alarm must be cleared.
pub fn halt(rig: &RigAddress, context: &Context<'_>) -> Result<()> {
    Ok(connect_to_stop(rig, context)?.client.halt()?)
}

fn connect_to_stop(rig: &RigAddress, context: &Context<'_>) -> Result<Rig> {
    let RigAddress::Port(port) = rig else { return Rig::connect(rig, None, context) };
    let mut client = Client::open_to_stop(port)?;
    client.interrupt_by(context.cancel.flag());
    Ok(Rig { client, emulation: None })
}
