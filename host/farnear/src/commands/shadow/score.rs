//! `farnear shadow score`: how much shadow was taken off masks, and how much of the subject with it.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::shadow::score::{self, ScoreSettings};

use crate::{report, terminal};

/// Scores shadow removal against a ground truth, over one mask or a folder of them.
///
/// Truth pictures are grey: 0 background, 50 (or 127) shadow, 255 person, 85 and 170 not judged. Masks are set from 128 on.
/// Frames of two folders belong together by name, else by the number that their names end in.
#[derive(Args)]
#[command(after_help = "Example: farnear shadow score masks/ truth/ --before raw-masks/ --json")]
pub struct Arguments {
    /// Masks after the removal: a picture or a folder.
    masks: PathBuf,
    /// The truth: a picture or a folder.
    truth: PathBuf,
    /// Masks before the removal. Then only pixels that were in them count as removed; without, all shadow that is not in
    /// the masks does. If the truth has no shadow, everything in these masks except the person counts as shadow.
    #[arg(long, value_name = "MASKS")]
    before: Option<PathBuf>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { masks, truth, before, json } = arguments;
    report::print(&score::score(&ScoreSettings { masks, truth, before }, &terminal::context()?)?, json)
}
