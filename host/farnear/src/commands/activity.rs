//! `farnear activity`: train, recognise, evaluate, list models.

mod evaluate;
mod method;
mod models;
mod recognise;
mod train;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Recognise what people do from their silhouettes: train a model, use it, evaluate the method.
#[derive(Args)]
#[command(after_help = "Example: farnear activity recognise masks/ --model everyday\n\
                        \x20        farnear activity train samples.toml --out model.fnm\n\
                        \x20        farnear activity recognise masks/ --model model.fnm")]
pub struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    Train(train::Arguments),
    Recognise(recognise::Arguments),
    Evaluate(evaluate::Arguments),
    Models(models::Arguments),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::Train(arguments) => train::run(arguments),
        Job::Recognise(arguments) => recognise::run(arguments),
        Job::Evaluate(arguments) => evaluate::run(arguments),
        Job::Models(arguments) => models::run(arguments),
    }
}
