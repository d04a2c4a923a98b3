//! `farnear activity`: train, recognise, evaluate, list models.

mod evaluate;
mod method;
mod models;
mod recognise;
mod train;

use anyhow::Result;
use clap::Subcommand;

#[derive(Subcommand)]
pub enum Job {
    Train(train::Arguments),
    Recognise(recognise::Recognise),
    Evaluate(evaluate::Arguments),
    Models(models::Arguments),
}

pub fn run(job: Job) -> Result<()> {
    match job {
        Job::Train(arguments) => train::run(arguments),
        Job::Recognise(task) => task.run(),
        Job::Evaluate(arguments) => evaluate::run(arguments),
        Job::Models(arguments) => models::run(arguments),
    }
}
