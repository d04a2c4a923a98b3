//! `farnear measure`: figures of a depth map, with their deviation.

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::measure::{
    MeasureDifferenceRequest, MeasurePlaneRequest, MeasureProfileRequest, MeasureRegionRequest,
};

use crate::run::Run;

/// Measure in a depth map: a region, the plane through it, a profile, the difference to another.
#[derive(Args)]
#[command(after_help = "Example: farnear measure region pair1/ --region 100,80,60,40 --json\n\
                        \x20        farnear measure profile pair1/ --from 0,240 --to 639,240 --json")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Region(Run<MeasureRegionRequest>),
    Plane(Run<MeasurePlaneRequest>),
    Profile(Run<MeasureProfileRequest>),
    Difference(Run<MeasureDifferenceRequest>),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.what {
        What::Region(task) => task.run(),
        What::Plane(task) => task.run(),
        What::Profile(task) => task.run(),
        What::Difference(task) => task.run(),
    }
}
