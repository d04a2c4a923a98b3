//! `farnear shadow`: shadow on masks of a person.

mod remove;
mod score;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Take a person's shadow off masks by where the sun stands, and score how well shadow was taken off.
#[derive(Args)]
#[command(after_help = "Example: farnear shadow score masks/ truth/ --json")]
pub struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    Remove(remove::Arguments),
    Score(score::Arguments),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::Remove(arguments) => remove::run(arguments),
        Job::Score(arguments) => score::run(arguments),
    }
}
