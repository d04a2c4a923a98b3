use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::measure::{
    MeasureDifferenceRequest, MeasurePlaneRequest, MeasureProfileRequest, MeasureRegionRequest,
};

use crate::run::Run;

#[derive(Subcommand)]
pub enum What {
    Region(Run<MeasureRegionRequest>),
    Plane(Run<MeasurePlaneRequest>),
    Profile(Run<MeasureProfileRequest>),
    Difference(Run<MeasureDifferenceRequest>),
}

pub fn run(what: What) -> Result<()> {
    match what {
        What::Region(task) => task.run(),
        What::Plane(task) => task.run(),
        What::Profile(task) => task.run(),
        What::Difference(task) => task.run(),
    }
}
