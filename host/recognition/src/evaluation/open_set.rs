//! Open-set evaluation: rates of unknown answers for trained and untrained activities. Each activity in turn
//! is left out of the training on one half of the subjects; the other half performs all, and vice versa.

use super::calibration::area_under_roc;
use super::leave_one_out::EvaluationError;
use crate::choice::names;
use crate::clip::Clip;
use crate::embedding::{EmbeddingError, descriptor::Scaling};
use crate::experiment::Experiment;
use crate::model::{ModelError, Recogniser};
use crate::unknown::Limits;
use crate::watch::{Unwatched, Watch};
use rayon::prelude::*;
use serde::Serialize;

/// Separation of unknown from known clips.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OpenSet {
    /// Activity left out of training; `None` for the mean over all.
    pub left_out: Option<String>,
    /// Clips of trained activities.
    pub known: usize,
    /// Share of known clips called unknown.
    pub unknown_of_known: f64,
    /// Clips of the untrained activity.
    pub strangers: usize,
    /// Share of those called unknown.
    pub unknown_of_strangers: f64,
    /// Area under the ROC curve of the outlier score.
    pub auroc: f64,
}

#[derive(Default)]
struct Scores {
    known: Vec<f32>,
    strange: Vec<f32>,
}

/// Leaves every activity out in turn, with the first settings of `experiment` and fused views. Returns a row
/// per activity and their mean last. Fails for fewer than 4 subjects or 3 activities, or too few clips.
pub fn open_set(
    clips: &[Clip],
    experiment: impl Fn(&str) -> Experiment + Sync,
    scaling: Scaling,
    watch: &dyn Watch,
) -> Result<Vec<OpenSet>, EvaluationError> {
    let activities = names(clips.iter().map(|clip| &clip.activity));
    let subjects = names(clips.iter().map(|clip| &clip.subject));
    if subjects.len() < 4 {
        return Err(EvaluationError::OpenSetSubjects(subjects.len()));
    }
    if activities.len() < 3 {
        return Err(EvaluationError::Activities(activities.len()));
    }
    let half = |clip: &Clip| subjects.iter().position(|subject| *subject == clip.subject).unwrap_or(0) % 2;
    let taught = |left_out: &str, tested: usize| {
        let is_taught = |clip: &&Clip| half(clip) != tested && clip.activity != left_out;
        clips.iter().filter(is_taught).collect::<Vec<_>>()
    };
    let counts = activities.iter().flat_map(|left_out| [0, 1].map(|tested| taught(left_out, tested).len()));
    let (found, fewest) = (counts.min().unwrap_or(0), Limits::fewest(Limits::FALSE_ALARMS));
    if found < fewest {
        return Err(EvaluationError::OpenSetClips { found, fewest });
    }
    let rows: Result<Vec<OpenSet>, EvaluationError> = activities
        .par_iter()
        .map(|left_out| {
            let mut scores = Scores::default();
            let fixed = experiment(left_out).fixed();
            for tested in 0..2 {
                if watch.is_stopped() {
                    return Err(EmbeddingError::Stopped.into());
                }
                let taught: Vec<Clip> = taught(left_out, tested).into_iter().cloned().collect();
                let (model, _) =
                    Recogniser::train_searched(&taught, &fixed, scaling, &Unwatched).map_err(of_model)?;
                for clip in clips.iter().filter(|clip| half(clip) == tested) {
                    let known = model.activities.contains(&clip.activity);
                    // The half that trains may lack other activities, too.
                    if !known && clip.activity != *left_out {
                        continue;
                    }
                    let score = model.recognise(&clip.views).map_err(of_model)?.outlier_score;
                    if known { scores.known.push(score) } else { scores.strange.push(score) }
                }
            }
            watch.fold_done(activities.len());
            Ok(scores.row(left_out))
        })
        .collect();
    let mut rows = rows?;
    rows.push(mean(&rows));
    Ok(rows)
}

fn of_model(error: ModelError) -> EvaluationError {
    match error {
        ModelError::Embedding(error) => error.into(),
        other => EvaluationError::Model(Box::new(other)),
    }
}

impl Scores {
    fn row(&self, left_out: &str) -> OpenSet {
        let unknown = |scores: &[f32]| {
            scores.iter().filter(|score| **score > 1.0).count() as f64 / scores.len().max(1) as f64
        };
        OpenSet {
            left_out: Some(left_out.into()),
            known: self.known.len(),
            unknown_of_known: unknown(&self.known),
            strangers: self.strange.len(),
            unknown_of_strangers: unknown(&self.strange),
            auroc: area_under_roc(&self.known, &self.strange),
        }
    }
}

fn mean(rows: &[OpenSet]) -> OpenSet {
    let over = |value: fn(&OpenSet) -> f64| rows.iter().map(value).sum::<f64>() / rows.len().max(1) as f64;
    OpenSet {
        left_out: None,
        known: rows.iter().map(|row| row.known).sum(),
        unknown_of_known: over(|row| row.unknown_of_known),
        strangers: rows.iter().map(|row| row.strangers).sum(),
        unknown_of_strangers: over(|row| row.unknown_of_strangers),
        auroc: over(|row| row.auroc),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Track;
    use crate::embedding::descriptor::{ANGLES, CELLS};
    use crate::space::SpaceSettings;
    use ndarray::Array2;
    use rand::{Rng, SeedableRng};

    #[test]
    fn activities_that_the_training_half_lacks_are_not_known() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut clip = |subject: &str, activity: usize| {
            let descriptors = Array2::from_shape_fn((10, ANGLES), |(frame, angle)| {
                let waves = (activity + 2) as f32 * (angle as f32).to_radians();
                0.35 + 0.1 * (waves + 0.3 * frame as f32).sin() + rng.random_range(-0.01..0.01_f32)
            });
            let view = Track { descriptors, cells: Array2::zeros((10, CELLS)), boxes: None, empty_frames: 0 };
            let activity = ["star", "turn", "wave", "hop"][activity].to_owned();
            Clip { subject: subject.into(), activity, views: vec![view] }
        };
        let mut clips = Vec::new();
        for subject in ["a", "b", "c", "d"] {
            for number in 0..15 {
                clips.push(clip(subject, number % 3));
            }
        }
        // Both in one half.
        clips.extend(["a", "c"].map(|subject| clip(subject, 3)));
        let experiment = Experiment::codebook(SpaceSettings::small());
        let rows = open_set(&clips, |_| experiment.clone(), Scaling::default(), &Unwatched).expect("rows");
        let counts = |name: &str| {
            let row = rows.iter().find(|row| row.left_out.as_deref() == Some(name)).expect("a row");
            (row.known, row.strangers)
        };
        assert_eq!((counts("star"), counts("hop")), ((40, 20), (60, 2)));
    }
}
