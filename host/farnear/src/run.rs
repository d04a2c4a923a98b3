//! Runs a task from its request and prints its figures.

use anyhow::Result;
use clap::Args;
use farnear_workflows::{
    Context,
    request::{CameraRequest, Request, RigRequest, outputs},
};

use crate::{
    commands::rig::target::{CameraArguments, Target},
    report, terminal,
};

// A task. Not a doc comment on these three: the help text of a command is that of its request.
#[derive(Args)]
pub struct Run<R: Request + Args> {
    #[command(flatten)]
    request: R,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl<R: Request + Args> Run<R> {
    pub fn run(self) -> Result<()> {
        let context = terminal::computing(self.json)?;
        self.run_in(&context)
    }

    fn run_in(self, context: &Context<'_>) -> Result<()> {
        let Self { request, json } = self;
        outputs::check(&request)?;
        outputs::check_folders(&request)?;
        let figures = request.run(context)?;
        report::print(&figures, json)?;
        Ok(R::verdict(&figures)?)
    }
}

// A task of a rig.
#[derive(Args)]
pub struct RigRun<R: RigRequest + Args> {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    task: Run<R>,
}

impl<R: RigRequest + Args> RigRun<R> {
    pub fn run(self) -> Result<()> {
        let Self { target, mut task } = self;
        task.request.set_rig(target.address()?);
        let context = terminal::counting(task.json)?;
        task.run_in(&context)
    }
}

// A task of a rig with a camera.
#[derive(Args)]
pub struct CameraRun<R: CameraRequest + Args> {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    task: Run<R>,
}

impl<R: CameraRequest + Args> CameraRun<R> {
    pub fn run(self) -> Result<()> {
        let Self { target, camera, mut task } = self;
        task.request.set_rig(target.address()?);
        task.request.set_camera(camera.settings()?);
        let context = terminal::counting(task.json)?;
        task.run_in(&context)
    }
}
