//! `farnear activity train`: samples, or synthetic people, to a model.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use farnear_workflows::activity::{
    shipped::{self, SyntheticTraining},
    training::{self, TrainingSettings},
};

use super::method::MethodArguments;
use crate::{report, terminal};

/// Trains a model on samples of masks.
///
/// SAMPLES.toml lists `[[sample]] masks = "dir" subject = "s01" activity = "walk" view = 1` with folders relative to itself.
/// Masks are full frames (the box's motion is learned too) or 100x100 (shapes only). Samples of one performance from several
/// views are fused; give them a common `clip = "name"` where a subject does an activity more than once and the order does not tell.
/// With two or more subjects the settings are chosen by cross-validation over them.
///
/// --synthetic makes models of everyday activities from seeded people alone, as those that come with the program were made: networks
/// that recognise from any one view, ordered and order-free, for full frames and for 100x100; --out is a new folder then.
#[derive(Args)]
#[command(after_help = "Example: farnear activity train samples.toml --out model.fnm --mode ordered\n\
                  \x20        farnear activity train --synthetic everyday --out models/")]
pub struct Arguments {
    /// The samples, TOML.
    #[arg(required_unless_present = "synthetic")]
    samples: Option<PathBuf>,
    /// Learn from synthetic people in place of samples.
    #[arg(long, value_name = "WHICH", conflicts_with_all = ["samples", "window", "any_view", "mode", "epl", "classifier", "no_search"])]
    synthetic: Option<Synthetic>,
    /// Synthetic people to learn from.
    #[arg(long, value_name = "COUNT", default_value_t = shipped::PEOPLE, requires = "synthetic")]
    people: usize,
    /// Passes of the learning over all synthetic people.
    #[arg(long, value_name = "COUNT", default_value_t = shipped::PASSES, requires = "synthetic")]
    passes: usize,
    /// The model to write, or with --synthetic the new folder for several.
    #[arg(long, value_name = "FILE|DIR")]
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

#[derive(Clone, Copy, ValueEnum)]
enum Synthetic {
    /// Walking, sitting down, waving, drinking, digging and so on (farnear activity models lists them).
    Everyday,
}

/// Runs the command.
///
/// # Errors
/// See [`training::train`] and [`shipped::train`].
pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    if let Some(Synthetic::Everyday) = arguments.synthetic {
        let settings =
            SyntheticTraining { people: arguments.people, passes: arguments.passes, out: arguments.out };
        return report::print(&shipped::train(&settings, &terminal::counting(json)?)?, json);
    }
    let Some(samples) = arguments.samples else {
        bail!(report::Usage("give samples, or --synthetic".into()))
    };
    let settings = TrainingSettings {
        samples,
        out: arguments.out,
        method: arguments.method.method(),
        window: arguments.window,
        any_view: arguments.any_view,
    };
    report::print(&training::train(&settings, &terminal::counting(json)?)?, json)
}
