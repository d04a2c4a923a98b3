//! Evaluates a finished model on labelled clips.

use std::{collections::BTreeSet, io, path::Path};

use farnear_files::staging::{Staging, StagingError};
use farnear_recognition::choice::Views;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::evaluation::{
    calibration::{Reliability, area_under_roc},
    confusion::{Confusion, wilson},
};
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::self_training::ROUNDS;
use rayon::prelude::*;
use serde::Serialize;

use super::{
    confusion_picture,
    evaluate::EvaluateRequest,
    recognition::Model,
    samples::{Samples, SamplesError},
};
use crate::{
    context::Context,
    counter::Counter,
    error::{Result, WorkflowError},
    figures::rounded,
};

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct JudgingFigures {
    /// For clips of known activities.
    pub answers: u32,
    /// Share of correct answers among all activities of the model.
    pub accuracy: f64,
    /// Wilson interval, 95 %, for as many independent trials as there are clips; the views of a performance are one.
    pub confidence_interval: [f64; 2],
    pub accuracy_among: f64,
    pub confidence_interval_among: [f64; 2],
    /// Expected calibration error, 0 to 1.
    pub calibration_error: f64,
    /// Expected calibration error among the samples' activities.
    pub calibration_error_among: f64,
    /// Share of known activities' clips called unknown.
    pub unknown_of_known: f64,
    /// Clips of unknown activities.
    pub strangers: u32,
    /// Share of unknown activities' clips called unknown; `None` without any.
    pub unknown_of_strangers: Option<f64>,
    /// Area under the outlier score's ROC curve; `None` without unknown activities.
    pub outlier_auroc: Option<f64>,
    /// Activities of the samples that the model lacks.
    pub not_known: Vec<String>,
    /// `counts[truth][answer]` among the samples' activities.
    pub confusion: Confusion,
}

pub(super) struct Judged<'a> {
    clip: &'a Clip,
    view: usize,
    /// In the model's names.
    pub truth: String,
    pub answer: Answer,
}

/// Evaluates the model on the samples of a request.
pub(super) fn judge(
    model: &Model,
    request: &EvaluateRequest,
    out: Option<&Staging>,
    context: &Context<'_>,
) -> Result<JudgingFigures> {
    check_views(request.views, model.recogniser(true).views)?;
    check_same(request, model)?;
    let samples = Samples::read_opened(&request.samples, request.open_blind_set.as_deref(), context)?;
    let activities = model.activities();
    let name = |activity: &str| request.name_in_model(activity);
    let fused = request.views == Some(Views::Fused);
    let recogniser = model.recogniser(samples.full_frames);
    let adapted = request
        .adapt
        .then(|| {
            let apart = |clip: &Clip| -> Vec<Vec<Track>> {
                if recogniser.views > 1 {
                    vec![clip.views.clone()]
                } else {
                    clip.views.iter().map(|v| vec![v.clone()]).collect()
                }
            };
            let clips: Vec<Vec<Track>> = samples.clips.iter().flat_map(apart).collect();
            recogniser.adapted(&clips, ROUNDS)
        })
        .transpose()?;
    let recogniser = adapted.as_ref().unwrap_or(recogniser);
    let judged = answers(recogniser, &samples.clips, fused, &name, context)?;
    warn_of_learned(recogniser, &samples, context)?;
    let (known, strange): (Vec<Judged>, Vec<Judged>) =
        judged.into_iter().partition(|judged| activities.contains(&judged.truth));
    let mut among: Vec<String> = known.iter().map(|judged| judged.truth.clone()).collect();
    among.sort();
    among.dedup();
    let mut not_known: Vec<String> = strange.iter().map(|judged| judged.clip.activity.clone()).collect();
    not_known.sort();
    not_known.dedup();
    if known.is_empty() {
        return Err(SamplesError::NothingInCommon {
            samples: request.samples.clone(),
            found: not_known,
            known: activities.to_vec(),
        }
        .into());
    }
    if !not_known.is_empty() {
        context.info(&format!("the model does not know: {}", not_known.join(", ")));
    }
    let figures = figures(&known, &strange, &among, not_known);
    if let Some(out) = out {
        out.write("confusion.png", &confusion_picture::png(&figures.confusion)?)?;
        out.write("confusion.md", figures.confusion.to_markdown().as_bytes())?;
        out.write(
            "wrong.csv",
            &wrong(&known, &among)
                .map_err(io::Error::from)
                .map_err(StagingError::at(Path::new("wrong.csv")))?,
        )?;
    }
    Ok(figures)
}

/// Refuses single views for a model that fuses several.
fn check_views(asked: Option<Views>, of_model: usize) -> Result<()> {
    if of_model > 1 && asked == Some(Views::Each) {
        let expected =
            format!("expected fused: the model fuses {of_model} views and does not answer for one");
        return Err(WorkflowError::parameter("views", "each", expected));
    }
    Ok(())
}

/// Warns of clips that the model was trained on.
pub(super) fn warn_of_learned(
    recogniser: &Recogniser,
    samples: &Samples,
    context: &Context<'_>,
) -> Result<()> {
    let learned = samples.clips.par_iter().map(|clip| {
        context.cancel.check("evaluating")?;
        recogniser.has_learned(&clip.views).map_err(WorkflowError::from)
    });
    let count = learned.collect::<Result<Vec<bool>>>()?.into_iter().filter(|learned| *learned).count();
    if count > 0 {
        context.progress.warn(&format!(
            "{}: the model was trained on {count} of {} clips: figures of clips that it has seen say nothing about others",
            samples.path.display(),
            samples.clips.len()
        ));
    }
    Ok(())
}

/// Refuses pairs of names of which the samples or the model lack one, and blind samples. Reads no masks.
pub(super) fn check_same(request: &EvaluateRequest, model: &Model) -> Result<()> {
    if request.same.is_empty() {
        return Ok(());
    }
    let mut of_samples = BTreeSet::new();
    for set in std::iter::once(&request.samples).chain(&request.leave_one_set_out) {
        let labels = Samples::labels(set, request.open_blind_set.as_deref())?;
        of_samples.extend(labels.into_iter().map(|[_, activity]| activity));
    }
    for (own, known) in request.same() {
        let same = || format!("{own}={known}");
        if !of_samples.contains(own) {
            // Only a recorded opening may show the names of a blind set.
            let only = match request.open_blind_set {
                Some(_) => String::new(),
                None => format!(", only {}", of_samples.into_iter().collect::<Vec<_>>().join(", ")),
            };
            let expected = format!("the samples have no activity `{own}`{only}");
            return Err(WorkflowError::parameter("same", same(), expected));
        }
        if !model.activities().iter().any(|activity| activity == known) {
            let expected =
                format!("the model has no activity `{known}`, only {}", model.activities().join(", "));
            return Err(WorkflowError::parameter("same", same(), expected));
        }
    }
    Ok(())
}

pub(super) fn answers<'a>(
    recogniser: &Recogniser,
    clips: &'a [Clip],
    fused: bool,
    name: &(dyn Fn(&str) -> String + Sync),
    context: &Context<'_>,
) -> Result<Vec<Judged<'a>>> {
    let counter = Counter::new(context, "clips recognised");
    let of_clip = |clip: &'a Clip| -> Result<Vec<Judged<'a>>> {
        counter.check("recognising clips")?;
        let together = fused || recogniser.views > 1;
        let views: Vec<&[Track]> = if together {
            vec![clip.views.as_slice()]
        } else {
            clip.views.iter().map(std::slice::from_ref).collect()
        };
        let judged = views.into_iter().enumerate().map(|(view, tracks)| {
            let answer = recogniser.recognise(tracks)?;
            Ok(Judged { clip, view: view + 1, truth: name(&clip.activity), answer })
        });
        let judged = judged.collect();
        counter.one(Some(clips.len()));
        judged
    };
    Ok(clips.par_iter().map(of_clip).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

fn figures(known: &[Judged], strange: &[Judged], among: &[String], not_known: Vec<String>) -> JudgingFigures {
    let mut confusion = Confusion::new(among.to_vec());
    let (mut free, mut restricted) = (Reliability::default(), Reliability::default());
    let place = |name: &str| among.iter().position(|class| class == name);
    let mut right = 0;
    for judged in known {
        let answer = judged.answer.among(among);
        let is_right = judged.answer.best() == Some(&judged.truth);
        right += u32::from(is_right);
        free.count(judged.answer.confidence, is_right);
        restricted.count(answer.confidence, answer.best() == Some(&judged.truth));
        if let (Some(truth), Some(found)) = (place(&judged.truth), answer.best().and_then(|name| place(name)))
        {
            confusion.count(truth, found);
        }
    }
    let scores = |of: &[Judged]| of.iter().map(|judged| judged.answer.outlier_score).collect::<Vec<f32>>();
    let unknown = |of: &[Judged]| {
        let count = of.iter().filter(|judged| judged.answer.outlier_score > 1.0).count();
        rounded(count as f64 / of.len().max(1) as f64, 4)
    };
    let answers = known.len() as u32;
    let accuracy = f64::from(right) / f64::from(answers);
    let clips = known.iter().filter(|judged| judged.view == 1).count() as u32;
    let (low, high) = wilson(accuracy, clips, 1.96);
    let (low_among, high_among) = confusion.interval(clips);
    let any = !strange.is_empty();
    JudgingFigures {
        answers,
        accuracy: rounded(accuracy, 4),
        confidence_interval: [rounded(low, 4), rounded(high, 4)],
        accuracy_among: rounded(confusion.accuracy(), 4),
        confidence_interval_among: [rounded(low_among, 4), rounded(high_among, 4)],
        calibration_error: rounded(free.expected_error(), 4),
        calibration_error_among: rounded(restricted.expected_error(), 4),
        unknown_of_known: unknown(known),
        strangers: strange.len() as u32,
        unknown_of_strangers: any.then(|| unknown(strange)),
        outlier_auroc: any.then(|| rounded(area_under_roc(&scores(known), &scores(strange)), 4)),
        not_known,
        confusion,
    }
}

/// Misclassified clips, the most confident first, as CSV.
fn wrong(known: &[Judged], among: &[String]) -> Result<Vec<u8>, csv::Error> {
    let mut found: Vec<(f32, [String; 6])> = known
        .iter()
        .filter_map(|judged| {
            let answer = judged.answer.among(among);
            let best = answer.best().filter(|best| *best != &judged.truth)?.clone();
            let Clip { subject, activity, views } = judged.clip;
            let frames = views.get(judged.view - 1).map_or(0, Track::frames);
            let [view, frames] = [judged.view, frames].map(|number| number.to_string());
            let confidence = format!("{:.4}", answer.confidence);
            Some((answer.confidence, [subject.clone(), activity.clone(), view, frames, best, confidence]))
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(["subject", "activity", "view", "frames", "answer", "confidence"])?;
    found.iter().try_for_each(|(_, row)| table.write_record(row))?;
    table.into_inner().map_err(|error| error.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_views_are_refused_for_a_model_of_several() {
        let error = check_views(Some(Views::Each), 4).expect_err("refused").to_string();
        assert!(error.contains("views each") && error.contains("4 views"), "{error}");
        assert!(check_views(Some(Views::Each), 1).is_ok() && check_views(None, 4).is_ok());
    }
}
