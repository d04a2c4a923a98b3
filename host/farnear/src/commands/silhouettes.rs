//! `farnear silhouettes`: masks of a person.

mod bodies;
mod markers;

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::silhouettes::{passages::PassagesRequest, video::SilhouettesVideoRequest};

use crate::run::Run;

/// Make silhouettes: masks of the person who moves in a video, or of a motion-capture recording from any view.
#[derive(Args)]
#[command(after_help = "Example: farnear silhouettes video walk.y4m --out masks/ --learn-first")]
pub struct Arguments {
    #[command(subcommand)]
    source: Source,
}

#[derive(Subcommand)]
enum Source {
    Skeletons(bodies::Skeletons),
    Synthetic(bodies::Synthetic),
    Markers(markers::Arguments),
    Video(Run<SilhouettesVideoRequest>),
    Passages(Run<PassagesRequest>),
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.source {
        Source::Skeletons(arguments) => bodies::skeletons(arguments),
        Source::Synthetic(arguments) => bodies::synthetic(arguments),
        Source::Markers(arguments) => markers::run(arguments),
        Source::Video(task) => task.run(),
        Source::Passages(task) => task.run(),
    }
}
