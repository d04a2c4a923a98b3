use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::{
    calibrate::{
        correction::CalibrateCorrectionRequest, psf::CalibratePsfRequest, stack::CalibrateStackRequest,
    },
    camera_frames::CalibrateCameraRequest,
};

use crate::run::Run;

#[derive(Subcommand)]
pub enum What {
    Psf(Run<CalibratePsfRequest>),
    Correction(Run<CalibrateCorrectionRequest>),
    Stack(Run<CalibrateStackRequest>),
    Camera(Run<CalibrateCameraRequest>),
}

pub fn run(what: What) -> Result<()> {
    match what {
        What::Psf(task) => task.run(),
        What::Correction(task) => task.run(),
        What::Stack(task) => task.run(),
        What::Camera(task) => task.run(),
    }
}
