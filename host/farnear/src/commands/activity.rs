//! `farnear activity`: train, recognise, evaluate, list models.

mod evaluate;
mod models;
mod recognise;

use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::activity::{shipped::TrainSyntheticRequest, training::TrainRequest};

use crate::run::Run;

#[derive(Subcommand)]
pub enum Job {
    Train(Run<TrainRequest>),
    TrainSynthetic(Run<TrainSyntheticRequest>),
    Recognise(recognise::Recognise),
    Evaluate(evaluate::Evaluate),
    Models(models::Arguments),
}

pub fn run(job: Job) -> Result<()> {
    match job {
        Job::Train(task) => task.run(),
        Job::TrainSynthetic(task) => task.run(),
        Job::Recognise(task) => task.run(),
        Job::Evaluate(task) => task.run(),
        Job::Models(arguments) => models::run(arguments),
    }
}
