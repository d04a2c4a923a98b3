//! `farnear activity evaluate`: how well the method recognises subjects that it was not trained on.

use std::{path::PathBuf, time::Instant};

use anyhow::{Context, Result};
use clap::Args;
use farnear_activity::{
    evaluation::{
        confusion::Confusion,
        leave_one_out::{Choice, EvaluationError, train_on_others},
    },
    mask::Mask,
    recognition::{
        choice::{Views, names},
        clip::{Clip, Track},
        experiment::Experiment,
        model::Recogniser,
    },
};
use farnear_capture::aside::Aside;
use serde::Serialize;

use super::{
    confusion,
    method::Method,
    samples::{SCALING, Samples, are_full_frames},
    train::fused,
};
use crate::{masks, report};

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
    method: Method,
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

#[derive(Serialize)]
struct Figures {
    /// Share of right answers, 0 to 1, and its 95 % interval (Wilson).
    accuracy: f64,
    confidence_interval: [f64; 2],
    right: u32,
    answers: u32,
    clips: usize,
    subjects: usize,
    views: Views,
    mode: &'static str,
    full_frames: bool,
    frames: usize,
    empty_frames: usize,
    /// From a mask in memory to its part of an answer, one thread.
    seconds_per_frame: f64,
    seconds: f64,
    /// `counts[truth][answer]`.
    confusion: Confusion,
}

/// `evaluation.toml`: nothing that differs between two runs.
#[derive(Serialize)]
struct Record {
    accuracy: f64,
    confidence_interval: [f64; 2],
    mode: &'static str,
    views: Views,
    fold: Vec<Choice>,
}

/// Runs the command.
///
/// # Errors
/// Samples that cannot be read or used, too few subjects, results that cannot be written.
pub fn run(arguments: &Arguments) -> Result<()> {
    if !arguments.leave_one_subject_out && arguments.train.is_none() {
        let what =
            "say what to learn from: --leave-one-subject-out (the other subjects), --train SAMPLES, or both";
        return Err(report::Usage(what.into()).into());
    }
    let start = Instant::now();
    let out = arguments.out.as_deref().map(Aside::new_folder).transpose()?;
    let shown = arguments.samples.display().to_string();
    let test = Samples::read(&arguments.samples)?;
    let train = arguments.train.as_deref().map(Samples::read).transpose()?;
    let (frames, empty_frames, full_frames) = (test.frames, test.empty_frames, test.full_frames);
    let folders = test.folders.clone();
    if let Some(train) = &train {
        anyhow::ensure!(
            train.full_frames == full_frames,
            "{shown} and --train differ: one holds full frames, the other cut-out silhouettes"
        );
    }
    let alike = test.views.is_some() && train.as_ref().is_none_or(|train| train.views == test.views);
    let views = arguments.views.unwrap_or(if alike { Views::Fused } else { Views::Each });
    let (test, train) = match (views, alike) {
        // Views that correspond each have a classifier of their own; others share one.
        (Views::Each, false) => (test.split(), train.map(Samples::split)),
        _ => {
            anyhow::ensure!(
                alike || test.views.is_none() || train.is_none(),
                "{shown} and --train hold other views; `--views each` takes every view by itself"
            );
            (fused(test, &shown)?, train.map(|train| fused(train, "--train")).transpose()?)
        }
    };
    let subjects = names(test.iter().map(|clip| &clip.subject));
    let learned = train.as_deref().unwrap_or(&test);
    check_subjects(arguments, &subjects, learned)?;
    arguments.method.announce();
    let experiment = arguments.method.experiment();
    let outcome = train_on_others(learned, &test, &experiment, &[views])?;
    let confusion = if views == Views::Each { outcome.each } else { outcome.fused };
    let (low, high) = confusion.interval();
    let (right, answers) = confusion.right_of();
    let accuracy = report::rounded(confusion.accuracy(), 5);
    let confidence_interval = [report::rounded(low, 5), report::rounded(high, 5)];
    if let Some(out) = out {
        let record = Record {
            accuracy,
            confidence_interval,
            mode: arguments.method.name(),
            views,
            fold: outcome.chosen,
        };
        out.write("confusion.png", &confusion::picture(&confusion)?)?;
        out.write("confusion.md", confusion.to_markdown().as_bytes())?;
        out.write("evaluation.toml", toml::to_string(&record)?.as_bytes())?;
        out.finish()?;
        eprintln!("wrote {}", arguments.out.as_deref().unwrap_or(&arguments.samples).display());
    }
    let figures = Figures {
        accuracy,
        confidence_interval,
        right,
        answers,
        clips: test.len(),
        subjects: subjects.len(),
        views,
        mode: arguments.method.name(),
        full_frames,
        frames,
        empty_frames,
        seconds_per_frame: seconds_per_frame(learned, experiment, &folders)?,
        seconds: report::rounded(start.elapsed().as_secs_f64(), 3),
        confusion,
    };
    if arguments.json {
        return report::print(&figures, true);
    }
    report::to_stdout(
        format!("{}\n{}", toml::to_string(&figures)?, figures.confusion.to_markdown()).as_bytes(),
    )
}

/// Refuses evaluations whose answers would mean nothing.
fn check_subjects(arguments: &Arguments, subjects: &[String], learned: &[Clip]) -> Result<()> {
    let known = names(learned.iter().map(|clip| &clip.subject));
    if arguments.leave_one_subject_out {
        if arguments.train.is_none() && subjects.len() < 3 {
            return Err(EvaluationError::Subjects(subjects.len()).into());
        }
        return Ok(());
    }
    if let Some(both) = subjects.iter().find(|subject| known.contains(subject)) {
        anyhow::bail!(
            "subject `{both}` is in both the samples and --train: recognising people by themselves says nothing; add \
             --leave-one-subject-out to leave them out of the training in turn"
        );
    }
    Ok(())
}

/// One thread's time from masks in memory to an answer, over the frames of the first clip.
fn seconds_per_frame(clips: &[Clip], experiment: Experiment, folders: &[PathBuf]) -> Result<f64> {
    let views = clips.first().map_or(0, |clip| clip.views.len());
    let (model, _) = Recogniser::train_searched(clips, &experiment.fixed(), SCALING)?;
    let sequences: Result<Vec<Vec<Mask>>> = folders
        .iter()
        .take(views)
        .map(|folder| Ok(masks::read_all(folder)?.into_iter().map(|named| named.mask).collect()))
        .collect();
    let sequences = sequences?;
    let frames: usize = sequences.iter().map(Vec::len).sum();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("cannot start a thread")?;
    let best = one.install(|| -> Result<f64> {
        let mut best = f64::INFINITY;
        for _ in 0..3 {
            let start = Instant::now();
            let tracks: Vec<Track> = sequences
                .iter()
                .map(|masks| Track::from_masks(masks, SCALING, are_full_frames(masks)))
                .collect();
            model.recognise(&tracks)?;
            best = best.min(start.elapsed().as_secs_f64());
        }
        Ok(best)
    })?;
    Ok(report::rounded(best / frames.max(1) as f64, 7))
}
