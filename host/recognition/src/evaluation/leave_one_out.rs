//! Leave-one-subject-out evaluation. Space, sharpness and classifier are chosen by cross-validation over the other
//! subjects ([`crate::choice`]) and trained on all of these. The left-out clips do not influence it.

use super::confusion::Confusion;
use crate::alignment::{Alignment, Statistics};
use crate::choice::{Views, choose, names};
use crate::classifier::{ClassifierKind, largest};
use crate::clip::Clip;
use crate::embedding::EmbeddingError;
use crate::experiment::Experiment;
use crate::patterns::{gathered, patterns_of, vectors_of};
use crate::self_training::{Labelled, self_trained};
use crate::space::SpaceSettings;
use crate::watch::{Unwatched, Watch};
use ndarray::Array2;
use rayon::prelude::*;
use serde::Serialize;

/// Answers over all left-out subjects.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Separate views, counted together.
    pub each: Confusion,
    /// Fused views of all clips.
    pub fused: Confusion,
    /// Choices of every fold.
    pub chosen: Vec<Choice>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// Subjects that were left out.
    pub left_out: Vec<String>,
    /// Separate or fused views.
    pub views: Views,
    /// Settings of embedding and patterns.
    pub space: SpaceSettings,
    /// Sharpness of soft assignments.
    pub sharpness: f32,
    pub classifier: ClassifierKind,
    /// Inner accuracy, 0 to 1.
    pub inner_accuracy: Option<f64>,
    /// Condition number of the RBF system, if any.
    pub condition: Option<f64>,
}

impl Outcome {
    fn empty(classes: &[String]) -> Self {
        let none = Confusion::new(classes.to_vec());
        Self { each: none.clone(), fused: none, chosen: Vec::new() }
    }
}

/// Why an evaluation failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    #[error("leave-one-subject-out needs at least 3 subjects, the samples have {0}")]
    Subjects(usize),
    /// Two halves of subjects, each enough for a threshold.
    #[error("an open set needs at least 4 subjects, the samples have {0}")]
    OpenSetSubjects(usize),
    #[error("an open set needs at least 3 activities, the samples have {0}")]
    Activities(usize),
    #[error(
        "each half of the subjects has to have at least {fewest} clips without the left-out activity for an open set, one has {found}: \
         fewer clips give no limit for a stated false-alarm rate; evaluate more people or clips"
    )]
    OpenSetClips { found: usize, fewest: usize },
    #[error(transparent)]
    Model(Box<crate::model::ModelError>),
    #[error(
        "clip {clip} has {found} views, the first has {expected}: fused views need the same in all clips"
    )]
    Views { clip: usize, found: usize, expected: usize },
    #[error(transparent)]
    Embedding(#[from] EmbeddingError),
}

/// Runs the experiment over all subjects.
pub fn leave_one_subject_out(clips: &[Clip], experiment: &Experiment) -> Result<Outcome, EvaluationError> {
    let subjects = names(clips.iter().map(|clip| &clip.subject));
    if subjects.len() < 3 {
        return Err(EvaluationError::Subjects(subjects.len()));
    }
    train_on_others(clips, clips, experiment, &[Views::Each, Views::Fused], &Unwatched)
}

/// Recognises the clips of every subject of `test`, trained on the other subjects of `train` (which may hold
/// the same people, e.g. clean clips for damaged ones). Other than the given arrangements of views stay
/// empty. `watch` receives every fold and may stop the work.
pub fn train_on_others(
    train: &[Clip],
    test: &[Clip],
    experiment: &Experiment,
    arrangements: &[Views],
    watch: &dyn Watch,
) -> Result<Outcome, EvaluationError> {
    let classes = names(train.iter().chain(test).map(|clip| &clip.activity));
    let views = train.first().map_or(0, |clip| clip.views.len());
    if let Some((clip, found)) =
        train.iter().chain(test).enumerate().find(|(_, clip)| clip.views.len() != views)
    {
        return Err(EvaluationError::Views { clip, found: found.views.len(), expected: views });
    }
    let subjects = names(test.iter().map(|clip| &clip.subject));
    // Disjoint training and test subjects need one training only.
    let shared = |subject: &String| train.iter().any(|clip| clip.subject == *subject);
    let (left_out, strangers): (Vec<&String>, Vec<&String>) = subjects.iter().partition(|s| shared(s));
    let mut groups: Vec<Vec<&String>> = left_out.into_iter().map(|subject| vec![subject]).collect();
    if !strangers.is_empty() {
        groups.push(strangers);
    }
    watch.folds_begin(groups.len(), experiment.spaces());
    let folds: Result<Vec<Outcome>, EvaluationError> = groups
        .par_iter()
        .map(|tested| {
            let kept: Vec<&Clip> = train.iter().filter(|clip| !tested.contains(&&clip.subject)).collect();
            let others = names(kept.iter().map(|clip| &clip.subject)).len();
            if others == 0 {
                return Err(EvaluationError::Subjects(1));
            }
            let mirrors: Vec<Clip> =
                if experiment.mirror { kept.iter().map(|c| c.mirrored()).collect() } else { Vec::new() };
            let training: Vec<&Clip> = kept.into_iter().chain(&mirrors).collect();
            let held: Vec<&Clip> = test.iter().filter(|clip| tested.contains(&&clip.subject)).collect();
            let fold = one_fold(&training, &held, &classes, views, experiment, arrangements, watch)?;
            watch.fold_done(groups.len());
            Ok(fold)
        })
        .collect();
    let mut outcome = Outcome::empty(&classes);
    for fold in folds? {
        outcome.each.add(&fold.each);
        outcome.fused.add(&fold.fused);
        outcome.chosen.extend(fold.chosen);
    }
    Ok(outcome)
}

fn one_fold(
    train: &[&Clip],
    test: &[&Clip],
    classes: &[String],
    views: usize,
    experiment: &Experiment,
    arrangements: &[Views],
    watch: &dyn Watch,
) -> Result<Outcome, EvaluationError> {
    let label = |clip: &&Clip| classes.iter().position(|class| *class == clip.activity).unwrap_or(0);
    let (train_labels, test_labels): (Vec<usize>, Vec<usize>) =
        (train.iter().map(label).collect(), test.iter().map(label).collect());
    let mut outcome = Outcome::empty(classes);
    let doubled = |&arrangement: &Views| {
        arrangement == Views::Fused && views == 1 && arrangements.contains(&Views::Each)
    };
    let asked: Vec<Views> =
        arrangements.iter().copied().filter(|arrangement| !doubled(arrangement)).collect();
    let chosen = choose(train, classes, experiment, &asked, watch)?;
    // A network taught on mirrors gives an auxiliary model for every clip.
    let mirrors: Vec<Clip> = if experiment.features.is_some() {
        test.iter().map(|clip| clip.mirrored()).collect()
    } else {
        Vec::new()
    };
    let all: Vec<&Clip> = test.iter().copied().chain(&mirrors).collect();
    let seen = vectors_of(&chosen.space, &all)?;
    let seen = match experiment.align {
        Alignment::None => seen,
        align => aligned(align, seen, &vectors_of(&chosen.space, train)?),
    };
    let tested = patterns_of(&chosen.space, &seen, chosen.sharpness);
    for arrangement in asked {
        let confusion = if arrangement == Views::Each { &mut outcome.each } else { &mut outcome.fused };
        for joint in arrangement.arrangements(views) {
            let training = gathered(&chosen.patterns, &joint);
            let labelled =
                Labelled { patterns: training.view(), labels: &train_labels, classes: classes.len() };
            let rows = gathered(&tested, &joint);
            let classifier = self_trained(chosen.classifier, labelled, rows.view(), experiment.self_training);
            let opinions: Vec<Vec<f32>> =
                rows.rows().into_iter().map(|row| classifier.probabilities(row)).collect();
            for (clip, &truth) in test_labels.iter().enumerate() {
                let mirror = opinions.get(test.len() + clip);
                confusion.count(truth, joint_answer(&opinions[clip], mirror.map(Vec::as_slice)));
            }
        }
        outcome.chosen.push(Choice {
            left_out: names(test.iter().map(|clip| &clip.subject)),
            views: arrangement,
            space: chosen.space.settings.clone(),
            sharpness: chosen.sharpness,
            classifier: chosen.classifier,
            inner_accuracy: chosen.inner_accuracy,
            condition: chosen.condition(),
        });
    }
    // A single view equals all views.
    if views == 1 && arrangements.contains(&Views::Each) {
        outcome.fused = outcome.each.clone();
    }
    Ok(outcome)
}

/// Class of the largest product of a clip's and its mirror's probabilities. As in a model's joint answers, a
/// probability of 0 does not exclude a class: nearest neighbours give next to none to all but a few.
fn joint_answer(clip: &[f32], mirror: Option<&[f32]>) -> usize {
    const LEAST: f32 = 1e-9;
    let Some(mirror) = mirror else { return largest(clip).0 };
    let products: Vec<f32> = clip.iter().zip(mirror).map(|(a, b)| a.max(LEAST) * b.max(LEAST)).collect();
    largest(&products).0
}

fn aligned(
    align: Alignment,
    seen: Vec<Vec<Array2<f32>>>,
    learned: &[Vec<Array2<f32>>],
) -> Vec<Vec<Array2<f32>>> {
    let of = |clips: &[Vec<Array2<f32>>]| Statistics::of(clips.iter().flatten());
    let (Some(own), Some(wanted)) = (of(&seen), of(learned)) else { return seen };
    let brought = own.to(&wanted, align);
    seen.iter().map(|views| views.iter().map(|view| brought.apply(view)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_with_another_vote_does_not_give_the_first_class() {
        assert_eq!(joint_answer(&[0.0, 1.0, 0.0], Some(&[0.0, 0.0, 1.0])), 1);
        assert_eq!(joint_answer(&[0.0, 0.4, 0.6], Some(&[0.0, 0.9, 0.1])), 1);
        assert_eq!(joint_answer(&[0.0, 0.4, 0.6], None), 2);
    }
}
