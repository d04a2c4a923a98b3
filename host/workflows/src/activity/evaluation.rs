//! Evaluates the method on subjects outside its training set.

use std::{path::PathBuf, time::Instant};

use farnear_files::{masks, staging::Staging};
use farnear_recognition::choice::{Views, names};
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::evaluation::{
    confusion::Confusion,
    leave_one_out::{Choice, EvaluationError, Outcome, train_on_others},
    open_set::{self, OpenSet},
};
use farnear_recognition::experiment::Experiment;
use farnear_recognition::model::Recogniser;
use farnear_recognition::self_training::ROUNDS;
use farnear_recognition::unknown::Limits;
use farnear_recognition::watch::Unwatched;
use farnear_silhouettes::mask::Mask;
use serde::Serialize;

use super::{
    confusion_picture, doubts,
    evaluate::EvaluateRequest,
    method::Method,
    samples::{SCALING, Samples, SamplesError, are_full_frames},
    training_progress,
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
};

/// Timing repetitions; the shortest counts.
const TIMINGS: usize = 3;

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct EvaluationFigures {
    pub accuracy: f64,
    /// Wilson interval, 95 %, for as many independent trials as there are clips.
    pub confidence_interval: [f64; 2],
    pub right: u32,
    pub answers: u32,
    /// The views of a performance are one clip.
    pub clips: usize,
    pub subjects: usize,
    pub views: Views,
    pub mode: &'static str,
    /// Whether masks are full frames, so that motion of the bounding box counts.
    pub full_frames: bool,
    pub frames: usize,
    pub empty_frames: usize,
    /// From a mask in memory to its part of an answer, one thread.
    pub seconds_per_frame: f64,
    pub seconds: f64,
    /// Activities of the samples that were not trained; their clips do not count.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_known: Vec<String>,
    /// `counts[truth][answer]`.
    pub confusion: Confusion,
}

#[derive(Serialize)]
struct Record<'a> {
    accuracy: f64,
    confidence_interval: [f64; 2],
    mode: &'static str,
    views: Views,
    fold: &'a [Choice],
}

/// Recognises every subject with a model of the others, or of the samples to train on.
pub(super) fn evaluate(
    request: &EvaluateRequest,
    out: Option<&Staging>,
    context: &Context<'_>,
) -> Result<EvaluationFigures> {
    let start = Instant::now();
    check_others(request)?;
    let method = request.method.method()?;
    method.announce(context);
    let mut test = Samples::read(&request.samples, context)?;
    let train = request.train.as_deref().map(|path| Samples::read(path, context)).transpose()?;
    doubts::warn(test.clips.iter().chain(train.iter().flat_map(|train| &train.clips)), context);
    let (frames, empty_frames, full_frames) = (test.frames, test.empty_frames, test.full_frames);
    let folders = test.folders.clone();
    let not_known = match &train {
        Some(train) => take_unknown(request, &mut test.clips, &train.clips)?,
        None => Vec::new(),
    };
    let clips = test.clips.len();
    let Clips { views, test, train } = Clips::of(test, train, request.views)?;
    if !not_known.is_empty() {
        context.progress.warn(&format!("not trained, so their clips do not count: {}", not_known.join(", ")));
    }
    let subjects = names(test.iter().map(|clip| &clip.subject));
    if request.train.is_none() && subjects.len() < 3 {
        return Err(EvaluationError::Subjects(subjects.len()).into());
    }
    let learned = train.as_deref().unwrap_or(&test);
    let untaught = doubts::untaught(&test, learned);
    if !untaught.is_empty() {
        context.progress.warn(&format!(
            "{}: taught by one subject only, whose own clips count as wrong: add clips of a second subject, or leave these out",
            untaught.join(", ")
        ));
    }
    let self_training = if request.adapt { ROUNDS } else { 0 };
    let experiment = Experiment { align: request.align, self_training, ..method.experiment(full_frames)? };
    let outcome =
        train_on_others(learned, &test, &experiment, &[views], &training_progress::Folds::new(context));
    let outcome = training_progress::outcome(outcome, context, "evaluating")?;
    let confusion = if views == Views::Each { &outcome.each } else { &outcome.fused };
    let (low, high) = confusion.interval(clips as u32);
    let (right, answers) = confusion.right_of();
    let mut figures = EvaluationFigures {
        accuracy: rounded(confusion.accuracy(), 5),
        confidence_interval: [rounded(low, 5), rounded(high, 5)],
        right,
        answers,
        clips,
        subjects: subjects.len(),
        views,
        mode: method.name(),
        full_frames,
        frames,
        empty_frames,
        seconds_per_frame: 0.0,
        seconds: 0.0,
        not_known,
        confusion: confusion.clone(),
    };
    if let Some(out) = out {
        write(&figures, &outcome, out)?;
    }
    figures.seconds_per_frame = seconds_per_frame(learned, &method, &folders, context)?;
    figures.seconds = rounded(start.elapsed().as_secs_f64(), 3);
    Ok(figures)
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OpenSetFigures {
    /// Largest share of known clips that models may call unknown.
    pub false_alarms: f64,
    /// Mean over the activities of the area under the outlier score's ROC curve.
    pub auroc: f64,
    /// Mean share of the left-out activities' clips called unknown.
    pub unknown_of_strangers: f64,
    /// Mean share of the other activities' clips called unknown.
    pub unknown_of_known: f64,
    pub activity: Vec<OpenSet>,
}

/// Leaves every activity out of the training in turn; half of the subjects train, the other half test.
pub(super) fn open_set(request: &EvaluateRequest, context: &Context<'_>) -> Result<OpenSetFigures> {
    // One setting for all rounds: a search in each would run dozens of times.
    let method = Method { search: false, ..request.method.method()? };
    let samples = Samples::read(&request.samples, context)?;
    doubts::warn(samples.clips.iter(), context);
    let experiment = method.experiment(samples.full_frames)?;
    let found = open_set::open_set(
        &samples.fused()?,
        |_| experiment.clone(),
        SCALING,
        &training_progress::Folds::new(context),
    );
    let mut rows = training_progress::outcome(found, context, "evaluating")?;
    for row in &mut rows {
        for value in [&mut row.unknown_of_known, &mut row.unknown_of_strangers, &mut row.auroc] {
            *value = rounded(*value, 4);
        }
    }
    let mean = rows.pop();
    let of_mean = |value: fn(&OpenSet) -> f64| mean.as_ref().map_or(f64::NAN, value);
    Ok(OpenSetFigures {
        false_alarms: rounded(f64::from(Limits::FALSE_ALARMS), 4),
        auroc: of_mean(|row| row.auroc),
        unknown_of_strangers: of_mean(|row| row.unknown_of_strangers),
        unknown_of_known: of_mean(|row| row.unknown_of_known),
        activity: rows,
    })
}

struct Clips {
    views: Views,
    test: Vec<Clip>,
    train: Option<Vec<Clip>>,
}

impl Clips {
    fn of(test: Samples, train: Option<Samples>, asked: Option<Views>) -> Result<Self> {
        if let Some(train) = &train {
            test.check_kind(train)?;
        }
        let alike = test.views.is_some() && train.as_ref().is_none_or(|train| train.views == test.views);
        let views = asked.unwrap_or(if alike { Views::Fused } else { Views::Each });
        // Corresponding views have a classifier each; others share one.
        if views == Views::Each && !alike {
            return Ok(Self { views, test: test.split(), train: train.map(Samples::split) });
        }
        if let (false, Some(_), Some(train)) = (alike, &test.views, &train) {
            let (test, train) = (test.path.clone(), train.path.clone());
            return Err(SamplesError::OtherViews { test, train }.into());
        }
        Ok(Self { views, test: test.fused()?, train: train.map(Samples::fused).transpose()? })
    }
}

/// Refuses subjects of other training samples, unless each is left out in turn. Reads no masks.
fn check_others(request: &EvaluateRequest) -> Result<()> {
    let Some(train) = request.train.as_ref().filter(|_| !request.leave_one_subject_out) else {
        return Ok(());
    };
    let tested = Samples::labels(&request.samples, None)?;
    let trained = Samples::labels(train, None)?;
    let [subjects, activities] = [0, 1].map(|at| names(trained.iter().map(|label| &label[at])));
    // Clips of other activities do not count.
    let counts =
        |[subject, activity]: &[String; 2]| subjects.contains(subject) && activities.contains(activity);
    let Some([subject, _]) = tested.into_iter().find(counts) else { return Ok(()) };
    let (test, train) = (request.samples.clone(), train.clone());
    Err(SamplesError::SamePerson { subject, test, train }.into())
}

/// Removes clips of activities outside the training set and returns these activities. Fails if no clip is left.
fn take_unknown(request: &EvaluateRequest, test: &mut Vec<Clip>, train: &[Clip]) -> Result<Vec<String>> {
    let known = names(train.iter().map(|clip| &clip.activity));
    let mut found = names(test.iter().map(|clip| &clip.activity));
    test.retain(|clip| known.contains(&clip.activity));
    if test.is_empty() {
        return Err(SamplesError::NothingInCommon { samples: request.samples.clone(), found, known }.into());
    }
    found.retain(|activity| !known.contains(activity));
    Ok(found)
}

fn write(figures: &EvaluationFigures, outcome: &Outcome, out: &Staging) -> Result<()> {
    let record = Record {
        accuracy: figures.accuracy,
        confidence_interval: figures.confidence_interval,
        mode: figures.mode,
        views: figures.views,
        fold: &outcome.chosen,
    };
    out.write("confusion.png", &confusion_picture::png(&figures.confusion)?)?;
    out.write("confusion.md", figures.confusion.to_markdown().as_bytes())?;
    Ok(out.write("evaluation.toml", toml::to_string(&record)?.as_bytes())?)
}

/// Time per frame of one thread, over the first clip, from masks in memory to an answer.
fn seconds_per_frame(
    clips: &[Clip],
    method: &Method,
    folders: &[PathBuf],
    context: &Context<'_>,
) -> Result<f64> {
    let views = clips.first().map_or(0, |clip| clip.views.len());
    let full_frames = clips.first().is_some_and(|clip| clip.views.iter().all(|view| view.boxes.is_some()));
    let experiment = method.experiment(full_frames)?.fixed();
    let (model, _) = Recogniser::train_searched(clips, &experiment, SCALING, &Unwatched)?;
    let sequences = folders
        .iter()
        .take(views)
        .map(|folder| Ok(masks::read_all(folder)?.pixels()))
        .collect::<Result<Vec<Vec<Mask>>>>()?;
    let frames: usize = sequences.iter().map(Vec::len).sum();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let one = one.map_err(|error| WorkflowError::Thread { reason: error.to_string() })?;
    let best = one.install(|| -> Result<f64> {
        let mut best = f64::INFINITY;
        for _ in 0..TIMINGS {
            context.cancel.check("taking the time of an answer")?;
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
    Ok(rounded(best / frames.max(1) as f64, 7))
}
