//! `farnear silhouettes passages`: a folder of masks cut into one folder per passage of a person.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::silhouettes::{
    markers::Performer,
    passages::{self, PassagesSettings},
};

use crate::{report, terminal};

/// Cuts a folder of masks into passages: at gaps in the numbers of their names, and at frames without a person.
///
/// Writes a folder of masks for every passage and `samples.toml` for `farnear activity`.
#[derive(Args)]
#[command(
    after_help = "Example: farnear silhouettes passages kth/person01 --activity walk --subject person01 --out passages/"
)]
pub struct Arguments {
    /// The folder of masks: pictures of black and white, JPEG too.
    masks: PathBuf,
    /// Activity in all of them.
    #[arg(long)]
    activity: String,
    /// Name of the person.
    #[arg(long)]
    subject: String,
    /// Folder for the passages and samples.toml; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Shorter passages are left out, frames.
    #[arg(long, default_value_t = 20)]
    least_frames: usize,
    /// Smallest person, px.
    #[arg(long, default_value_t = 200)]
    least_px: usize,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let settings = PassagesSettings {
        masks: arguments.masks,
        out: arguments.out,
        performer: Performer { subject: arguments.subject, activity: arguments.activity },
        least_frames: arguments.least_frames,
        least_px: arguments.least_px,
    };
    report::print(&passages::cut(&settings, &terminal::counting(arguments.json)?)?, arguments.json)
}
