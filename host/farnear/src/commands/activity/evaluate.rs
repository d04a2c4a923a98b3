//! `farnear activity evaluate`: recognition of subjects outside the training, or by a stored model.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_recognition::alignment::Alignment;
use farnear_recognition::choice::Views;
use farnear_recognition::evaluation::confusion::Confusion;
use farnear_recognition::self_training::ROUNDS;
use farnear_workflows::activity::{
    evaluation::{self, EvaluationSettings, LearnFrom},
    judging::{self, JudgingSettings},
    method::{Adaptation, Method},
    recognition::Model,
    sets::{self, SetsSettings},
};

use serde::Serialize;

use super::method::MethodArguments;
use crate::{report, terminal};

/// Evaluates the method: every subject is recognised by a model of the others.
///
/// With --leave-one-subject-out each subject in turn is left out of the training, in which everything that can be
/// chosen is chosen by cross-validation over the remaining subjects. --train gives other samples to learn from (clean
/// masks for damaged ones of the same people, say; a subject's own are left out as before). Without
/// --leave-one-subject-out but with --train all of that is learned from, and the subjects must be others.
///
/// --open-set leaves out activities instead of subjects: half of the subjects train the others, the other half performs all.
///
/// --model judges a finished model instead: answers among all that it knows and among what the samples hold, how far confidences are
/// from the fraction of right answers, how many known and unknown activities it calls unknown. With --leave-one-set-out it is judged on several
/// sets: expect of a new set the figures of the worst left-out one.
#[derive(Args)]
#[command(
    after_help = "Example: farnear activity evaluate samples.toml --leave-one-subject-out --mode ordered --json\n\
         \x20        farnear activity evaluate samples.toml --model everyday --same 'clap hands=clap' --out judged/\n\
         \x20        farnear activity evaluate one/samples.toml --model everyday --leave-one-set-out two/samples.toml three/samples.toml"
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
    /// Judge this model: a file, or the name of one that comes with the program.
    #[arg(long, value_name = "FILE|NAME", conflicts_with_all = ["leave_one_subject_out", "train", "mode", "epl", "classifier", "no_search", "features"])]
    model: Option<PathBuf>,
    /// Judge the model on these sets too, each with a limit for unknown activities that the other sets give.
    #[arg(long, value_name = "SAMPLES", num_args = 1.., requires = "model", conflicts_with_all = ["open_set", "adapt", "views", "out"])]
    leave_one_set_out: Vec<PathBuf>,
    /// Open sets that their samples file marks as blind, for this reason; every opening is recorded in openings.csv next to the file.
    #[arg(long, value_name = "REASON", requires = "model")]
    open_blind_set: Option<String>,
    /// An activity's name in the samples and in the model, where they differ; may be repeated.
    #[arg(long, value_name = "SAMPLES=MODEL", requires = "model", value_parser = same)]
    same: Vec<(String, String)>,
    /// Leave every activity out of the training in turn, and report how often it is called unknown.
    #[arg(long, conflicts_with_all = ["leave_one_subject_out", "train", "model", "views", "out"])]
    open_set: bool,
    /// Learn on from one's own surest answers for the clips that are recognised, without their labels: for clips from another camera,
    /// sensor or laboratory than those learned from.
    #[arg(long, conflicts_with = "open_set")]
    adapt: bool,
    /// Bring the frames of the clips that are recognised to those learned from, without labels: their mean, their mean and spread, or their
    /// covariance too (coral).
    #[arg(long, value_name = "none|mean|spread|coral", default_value = "none", conflicts_with_all = ["open_set", "model"])]
    align: Alignment,
    #[command(flatten)]
    method: MethodArguments,
    /// each: every view by itself, answers counted together; fused: all views of a clip at once [default: fused, or each where clips
    /// differ in their views].
    #[arg(long)]
    views: Option<Views>,
    /// Folder for confusion.png, confusion.md and evaluation.toml (the choices of every fold), or wrong.csv (a model's mistakes).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

fn same(text: &str) -> Result<(String, String), String> {
    let (own, known) = text.split_once('=').ok_or("expected NAME IN THE SAMPLES=NAME IN THE MODEL")?;
    Ok((own.trim().into(), known.trim().into()))
}

pub fn run(arguments: Arguments) -> Result<()> {
    if let Some(model) = arguments.model.as_ref().filter(|_| !arguments.leave_one_set_out.is_empty()) {
        let sets = [vec![arguments.samples], arguments.leave_one_set_out].concat();
        let settings = SetsSettings { sets, same: arguments.same, open_blind: arguments.open_blind_set };
        let context = terminal::counting(arguments.json)?;
        let figures = sets::leave_one_set_out(&Model::read(model)?, &settings, &context)?;
        return report::print(&figures, arguments.json);
    }
    if let Some(model) = &arguments.model {
        let settings = JudgingSettings {
            samples: arguments.samples,
            same: arguments.same,
            fused: arguments.views == Some(Views::Fused),
            self_training: if arguments.adapt { ROUNDS } else { 0 },
            open_blind: arguments.open_blind_set,
            out: arguments.out,
        };
        let figures = judging::judge(&Model::read(model)?, &settings, &terminal::counting(arguments.json)?)?;
        return printed(&figures, &figures.confusion, arguments.json);
    }
    if arguments.open_set {
        // One setting for all rounds: a search in each would run dozens of times.
        let method = Method { search: false, ..arguments.method.method() };
        let context = terminal::counting(arguments.json)?;
        return report::print(&evaluation::open_set(&arguments.samples, &method, &context)?, arguments.json);
    }
    let learn_from = match (arguments.leave_one_subject_out, arguments.train) {
        (true, None) => LearnFrom::OtherSubjects,
        (true, Some(train)) => LearnFrom::SamplesOfOthers(train),
        (false, Some(train)) => LearnFrom::Samples(train),
        (false, None) => bail!(report::Usage(
            "say what to learn from: --leave-one-subject-out (the other subjects), --train SAMPLES, or both; or --open-set; or --model to \
             judge a finished one"
                .into()
        )),
    };
    let settings = EvaluationSettings {
        samples: arguments.samples,
        learn_from,
        method: arguments.method.method(),
        adaptation: Adaptation {
            align: arguments.align,
            self_training: if arguments.adapt { ROUNDS } else { 0 },
        },
        views: arguments.views,
        out: arguments.out,
    };
    let figures = evaluation::evaluate(&settings, &terminal::counting(arguments.json)?)?;
    printed(&figures, &figures.confusion, arguments.json)
}

/// Prints figures; for people the confusion is a table.
fn printed<T: Serialize>(figures: &T, confusion: &Confusion, json: bool) -> Result<()> {
    report::print(figures, json)?;
    if json {
        return Ok(());
    }
    report::to_stdout(format!("\n{}", confusion.to_markdown()).as_bytes())
}
