//! Leave-one-set-out: evaluates a finished model, and thresholds from the other sets, on each set. A blind set
//! (`blind = "why"`) needs a reason, which is recorded in `openings.csv` next to it.

use std::path::Path;

use farnear_recognition::evaluation::calibration::{Reliability, area_under_roc};
use farnear_recognition::model::Recogniser;
use farnear_recognition::unknown::Limits;
use serde::Serialize;

use super::{
    evaluate::EvaluateRequest,
    judging::{Judged, answers, check_same, warn_of_learned},
    recognition::Model,
    samples::{Samples, SamplesError},
};
use crate::{context::Context, error::Result, figures::rounded};

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SetFigures {
    pub set: String,
    pub answers: usize,
    /// Share of correct single-view answers among all activities of the model.
    pub accuracy: f64,
    /// As `accuracy`, among the activities of the set.
    pub accuracy_among: f64,
    /// Expected calibration error among the set's activities.
    pub calibration_error_among: f64,
    /// Share of known clips called unknown by the model's own limits.
    pub unknown_of_known: f64,
    /// As `unknown_of_known`, by `limit_of_other_sets`; `None` without a limit.
    pub unknown_of_known_by_other_sets: Option<f64>,
    /// Outlier score that gives the promised share on the other sets together; `None` where they hold too few clips.
    pub limit_of_other_sets: Option<f64>,
    pub strangers: usize,
    /// Share of unknown activities called unknown by `limit_of_other_sets`; `None` without any.
    pub unknown_of_strangers_by_other_sets: Option<f64>,
    /// Area under the outlier score's ROC curve; `None` without unknown activities.
    pub outlier_auroc: Option<f64>,
    /// As `outlier_auroc`, mean over the set's activities, each in turn removed from the answers of the model;
    /// `None` for fewer than two activities or a model that is not a network.
    pub left_out_auroc: Option<f64>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SetsFigures {
    /// Largest share of known clips that the limits promise to call unknown.
    pub promised_unknown_of_known: f64,
    /// Largest measured share on a left-out set: the expectation for a new one.
    pub worst_unknown_of_known: f64,
    /// As `worst_unknown_of_known`, by the limits of the other sets.
    pub worst_unknown_of_known_by_other_sets: Option<f64>,
    pub sets: Vec<SetFigures>,
}

struct Measured {
    name: String,
    known: Vec<(f32, bool)>,
    strange: Vec<f32>,
    right: usize,
    right_among: usize,
    reliability: Reliability,
    left_out_auroc: Option<f64>,
}

/// Evaluates the model on the samples of a request and on its other sets.
pub(super) fn leave_one_set_out(
    model: &Model,
    request: &EvaluateRequest,
    context: &Context<'_>,
) -> Result<SetsFigures> {
    check_same(request, model)?;
    let measured = std::iter::once(&request.samples)
        .chain(&request.leave_one_set_out)
        .map(|path| measured(model, path, request, context))
        .collect::<Result<Vec<Measured>>>()?;
    let sets: Vec<SetFigures> = (0..measured.len()).map(|left_out| figures(&measured, left_out)).collect();
    let worst = |of: fn(&SetFigures) -> Option<f64>| sets.iter().filter_map(of).reduce(f64::max);
    Ok(SetsFigures {
        promised_unknown_of_known: rounded(f64::from(Limits::FALSE_ALARMS), 4),
        worst_unknown_of_known: worst(|set| Some(set.unknown_of_known)).unwrap_or_default(),
        worst_unknown_of_known_by_other_sets: worst(|set| set.unknown_of_known_by_other_sets),
        sets,
    })
}

fn measured(
    model: &Model,
    path: &Path,
    request: &EvaluateRequest,
    context: &Context<'_>,
) -> Result<Measured> {
    let samples = Samples::read_opened(path, request.open_blind_set.as_deref(), context)?;
    let name = |activity: &str| request.name_in_model(activity);
    let recogniser = model.recogniser(samples.full_frames);
    let judged = answers(recogniser, &samples.clips, false, &name, context)?;
    warn_of_learned(recogniser, &samples, context)?;
    let (known, strange): (Vec<Judged>, Vec<Judged>) =
        judged.into_iter().partition(|judged| model.activities().contains(&judged.truth));
    if known.is_empty() {
        let mut found: Vec<String> = strange.iter().map(|judged| judged.truth.clone()).collect();
        found.sort();
        found.dedup();
        let known = model.activities().to_vec();
        return Err(SamplesError::NothingInCommon { samples: path.into(), found, known }.into());
    }
    let mut among: Vec<String> = known.iter().map(|judged| judged.truth.clone()).collect();
    among.sort();
    among.dedup();
    let mut measured = Measured {
        name: path
            .parent()
            .and_then(Path::file_name)
            .unwrap_or(path.as_os_str())
            .to_string_lossy()
            .into_owned(),
        known: Vec::new(),
        strange: strange.iter().map(|judged| judged.answer.outlier_score).collect(),
        right: 0,
        right_among: 0,
        reliability: Reliability::default(),
        left_out_auroc: left_out_auroc(recogniser, &known, &among),
    };
    for judged in &known {
        let answer = judged.answer.among(&among);
        let right = judged.answer.best() == Some(&judged.truth);
        let right_among = answer.best() == Some(&judged.truth);
        measured.right += usize::from(right);
        measured.right_among += usize::from(right_among);
        measured.reliability.count(answer.confidence, right_among);
        measured.known.push((judged.answer.outlier_score, right_among));
    }
    Ok(measured)
}

fn left_out_auroc(recogniser: &Recogniser, known: &[Judged], among: &[String]) -> Option<f64> {
    let of_activity = |activity: &String| {
        let (mut others, mut own) = (Vec::new(), Vec::new());
        for judged in known {
            let score = recogniser.outlier_score_without(&judged.answer, activity)?;
            if judged.truth == *activity { &mut own } else { &mut others }.push(score);
        }
        Some(area_under_roc(&others, &own))
    };
    let areas = among.iter().map(of_activity).collect::<Option<Vec<f64>>>()?;
    (areas.len() > 1).then(|| areas.iter().sum::<f64>() / areas.len() as f64)
}

fn figures(measured: &[Measured], left_out: usize) -> SetFigures {
    let set = &measured[left_out];
    // Sets have equal weights, independent of their number of clips.
    let others: Vec<&Measured> =
        measured.iter().enumerate().filter(|(index, _)| *index != left_out).map(|(_, set)| set).collect();
    let largest = others.iter().map(|set| set.known.len()).max().unwrap_or(1);
    let scored: Vec<(usize, f32)> = others
        .iter()
        .flat_map(|set| set.known.iter().map(|(score, _)| (0, *score)).cycle().take(largest))
        .collect();
    let limit = Limits::conformal(&scored, 1, Limits::FALSE_ALARMS).distances[0];
    let share = |count: usize, of: usize| rounded(count as f64 / of.max(1) as f64, 4);
    let beyond = |scores: &[f32], limit: f32| scores.iter().filter(|score| **score > limit).count();
    let known: Vec<f32> = set.known.iter().map(|(score, _)| *score).collect();
    let any = !set.strange.is_empty();
    SetFigures {
        set: set.name.clone(),
        answers: known.len(),
        accuracy: share(set.right, known.len()),
        accuracy_among: share(set.right_among, known.len()),
        calibration_error_among: rounded(set.reliability.expected_error(), 4),
        unknown_of_known: share(beyond(&known, 1.0), known.len()),
        unknown_of_known_by_other_sets: limit.is_finite().then(|| share(beyond(&known, limit), known.len())),
        limit_of_other_sets: limit.is_finite().then(|| rounded(f64::from(limit), 4)),
        strangers: set.strange.len(),
        unknown_of_strangers_by_other_sets: (any && limit.is_finite())
            .then(|| share(beyond(&set.strange, limit), set.strange.len())),
        outlier_auroc: any.then(|| rounded(area_under_roc(&known, &set.strange), 4)),
        left_out_auroc: set.left_out_auroc.map(|area| rounded(area, 4)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(name: &str, scores: impl Iterator<Item = f32>) -> Measured {
        Measured {
            name: name.into(),
            known: scores.map(|score| (score, true)).collect(),
            strange: vec![5.0, 6.0],
            right: 10,
            right_among: 20,
            reliability: Reliability::default(),
            left_out_auroc: None,
        }
    }

    #[test]
    fn the_limit_comes_from_the_other_sets_alone() {
        // The first set's scores are twice as high; the others give 5 % among themselves.
        let scores = |factor: f32| (0..100).map(move |n| factor * n as f32 / 100.0);
        let sets = [set("far", scores(2.0)), set("a", scores(1.0)), set("b", scores(1.0))];
        let far = figures(&sets, 0);
        assert!((far.limit_of_other_sets.unwrap() - 0.95).abs() < 0.03, "{far:?}");
        assert!((far.unknown_of_known_by_other_sets.unwrap() - 0.52).abs() < 0.03, "{far:?}");
        assert!((far.unknown_of_known - 0.49).abs() < 0.02, "{far:?}");
        assert_eq!((far.unknown_of_strangers_by_other_sets, far.outlier_auroc), (Some(1.0), Some(1.0)));
        let near = figures(&sets, 1);
        assert!(near.limit_of_other_sets > Some(1.5), "{near:?}");
        assert_eq!(near.unknown_of_known_by_other_sets, Some(0.0), "{near:?}");
    }

    #[test]
    fn too_few_clips_in_the_other_sets_give_no_limit() {
        let scores = || (0..5).map(|n| n as f32 / 10.0);
        let found = figures(&[set("a", scores()), set("b", scores())], 0);
        assert_eq!((found.limit_of_other_sets, found.unknown_of_known_by_other_sets), (None, None));
        assert_eq!(found.unknown_of_strangers_by_other_sets, None);
    }
}
