//! `farnear activity train`: samples to a model.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::activity::training::{self, TrainingSettings};

use super::method::MethodArguments;
use crate::{report, terminal};

/// Trains a model on samples of masks.
///
/// SAMPLES.toml lists `[[sample]] masks = "dir" subject = "s01" activity = "walk" view = 1` with folders relative to itself.
/// Masks are full frames (the box's motion is learned too) or 100x100 (shapes only). Samples of one performance from several
/// views are fused; give them a common `clip = "name"` where a subject does an activity more than once and the order does not tell.
/// With two or more subjects the settings are chosen by cross-validation over them.
#[derive(Args)]
#[command(after_help = "Example: farnear activity train samples.toml --out model.fnm --mode ordered")]
pub struct Arguments {
    /// The samples, TOML.
    samples: PathBuf,
    /// The model to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    method: MethodArguments,
    /// Cut clips into windows of so many frames first: for recognition in recordings that nobody cut.
    #[arg(long, value_name = "FRAMES")]
    window: Option<usize>,
    /// Take every view as a clip of its own, so that the model recognises from one view, whichever it is.
    #[arg(long)]
    any_view: bool,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// See [`training::train`].
pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    let settings = TrainingSettings {
        samples: arguments.samples,
        out: arguments.out,
        method: arguments.method.method(),
        window: arguments.window,
        any_view: arguments.any_view,
    };
    report::print(&training::train(&settings, &terminal::counting(json)?)?, json)
}
