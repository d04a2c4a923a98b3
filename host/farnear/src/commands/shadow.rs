//! `farnear shadow`: shadow on masks of a person.

mod score;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Score how well shadow was taken off masks.
#[derive(Args)]
#[command(after_help = "Example: farnear shadow score masks/ truth/ --json")]
pub struct Arguments {
    #[command(subcommand)]
    job: Job,
}

#[derive(Subcommand)]
enum Job {
    Score(score::Arguments),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.job {
        Job::Score(arguments) => score::run(&arguments),
    }
}
