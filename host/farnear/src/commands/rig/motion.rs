use anyhow::{Result, bail};
use clap::Args;
use farnear_protocol::message::Axis;
use farnear_workflows::rig::motion::{self, MoveSettings};

use super::{AxisName, Target};
use crate::{
    report::{self, Usage},
    terminal,
};

/// Find the home switches and make them position 0: of all stages at once, or of those that are named.
#[derive(Args)]
#[command(after_help = "Example: farnear rig home --port /dev/ttyACM0 --axis lens")]
pub struct HomeArguments {
    #[command(flatten)]
    target: Target,
    /// The axis to home; may be given again. Without it all that have a home switch.
    #[arg(long, value_name = "AXIS")]
    axis: Vec<AxisName>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Move to absolute positions, several axes at once; outside the limits it is refused.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig move --port /dev/ttyACM0 --axis coarse --to-um 5800 --axis lens --to-um 1000"
)]
pub struct MoveArguments {
    #[command(flatten)]
    target: Target,
    /// The axis; may be given again, each with its --to-um.
    #[arg(long, value_name = "AXIS", required = true)]
    axis: Vec<AxisName>,
    /// The position in micrometres, positive = sensor and lens away from each other; 0 = home switch, or relaxed piezo.
    #[arg(long, value_name = "UM", allow_negative_numbers = true, required = true)]
    to_um: Vec<f64>,
    /// Home axes first that are not homed.
    #[arg(long)]
    home: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub fn home(arguments: HomeArguments) -> Result<()> {
    let axes: Vec<_> = arguments.axis.iter().map(|name| Axis::from(*name)).collect();
    let address = arguments.target.address()?;
    report::print(&motion::home(&address, &axes, &terminal::context()?)?, arguments.json)
}

pub fn go(arguments: MoveArguments) -> Result<()> {
    let MoveArguments { target, axis: axes, to_um, home, json } = arguments;
    if axes.len() != to_um.len() {
        let (axes, positions) = (axes.len(), to_um.len());
        bail!(Usage(format!("--axis is given {axes} times and --to-um {positions} times: they go together")));
    }
    if let Some(twice) =
        axes.iter().enumerate().find_map(|(at, axis)| axes[..at].contains(axis).then_some(axis))
    {
        bail!(Usage(format!("--axis {} is given twice", Axis::from(*twice).name())));
    }
    let targets = axes.iter().map(|name| Axis::from(*name)).zip(to_um).collect();
    let settings = MoveSettings { rig: target.address()?, targets, home };
    report::print(&motion::move_to(&settings, &terminal::context()?)?, json)
}
