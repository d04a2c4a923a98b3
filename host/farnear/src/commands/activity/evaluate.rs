//! `farnear activity evaluate`: how well the method recognises subjects that it was not trained on.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_activity::recognition::choice::Views;
use farnear_workflows::activity::evaluation::{self, EvaluationSettings, LearnFrom};

use super::method::MethodArguments;
use crate::{report, terminal};

/// Evaluates the method: every subject is recognised by what was learned from the others.
///
/// With --leave-one-subject-out each subject in turn is left out of the training, in which everything that can be
/// chosen is chosen by cross-validation over the remaining subjects. --train gives other samples to learn from (clean
/// masks for damaged ones of the same people, say; a subject's own are left out as before). Without
/// --leave-one-subject-out but with --train all of that is learned from, and the subjects must be others.
#[derive(Args)]
#[command(
    after_help = "Example: farnear activity evaluate samples.toml --leave-one-subject-out --mode ordered --json"
)]
pub struct Arguments {
    /// The samples, TOML (see farnear activity train --help).
    samples: PathBuf,
    /// Leave every subject out in turn.
    #[arg(long)]
    leave_one_subject_out: bool,
    /// Learn from these samples instead.
    #[arg(long, value_name = "SAMPLES")]
    train: Option<PathBuf>,
    #[command(flatten)]
    method: MethodArguments,
    /// each: every view by itself, answers counted together; fused: all views of a clip at once [default: fused, or each where clips
    /// differ in their views].
    #[arg(long)]
    views: Option<Views>,
    /// Folder for confusion.png, confusion.md and evaluation.toml (what was chosen in every fold).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// See [`evaluation::evaluate`]; nothing to learn from.
pub fn run(arguments: Arguments) -> Result<()> {
    let learn_from = match (arguments.leave_one_subject_out, arguments.train) {
        (true, None) => LearnFrom::OtherSubjects,
        (true, Some(train)) => LearnFrom::SamplesOfOthers(train),
        (false, Some(train)) => LearnFrom::Samples(train),
        (false, None) => bail!(report::Usage(
            "say what to learn from: --leave-one-subject-out (the other subjects), --train SAMPLES, or both"
                .into()
        )),
    };
    let settings = EvaluationSettings {
        samples: arguments.samples,
        learn_from,
        method: arguments.method.method(),
        views: arguments.views,
        out: arguments.out,
    };
    let figures = evaluation::evaluate(&settings, &terminal::counting(arguments.json)?)?;
    report::print(&figures, arguments.json)?;
    if arguments.json {
        return Ok(());
    }
    report::to_stdout(format!("\n{}", figures.confusion.to_markdown()).as_bytes())
}
