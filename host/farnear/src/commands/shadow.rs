use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::shadow::{removal::ShadowRemoveRequest, score::ShadowScoreRequest};

use crate::run::Run;

#[derive(Subcommand)]
pub enum Job {
    Remove(Run<ShadowRemoveRequest>),
    Score(Run<ShadowScoreRequest>),
}

pub fn run(job: Job) -> Result<()> {
    match job {
        Job::Remove(task) => task.run(),
        Job::Score(task) => task.run(),
    }
}
