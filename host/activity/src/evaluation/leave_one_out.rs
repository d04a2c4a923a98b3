//! Leave one subject out, all parameters chosen on the others.
//!
//! Per left-out subject: the space (gallery, Isomap, RBF map, codebook) is learned from the other subjects' clips; sharpness and the
//! classifier's parameter are chosen by cross-validation over those subjects; the classifier is trained on all of them; the
//! left-out subject's clips are recognised once. Nothing of the left-out subject is ever seen before.

use super::confusion::Confusion;
use crate::embedding::EmbeddingError;
use crate::recognition::classifier::{Classifier, ClassifierKind};
use crate::recognition::clip::Clip;
use crate::recognition::knn;
use crate::recognition::occupancy::rows;
use crate::recognition::space::{PatternKind, Space, SpaceSettings};
use crate::recognition::svc::DualSvc;
use ndarray::{Array1, Array2};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// What is tried, and what is chosen from.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// The spaces to choose from (one, or several with other members per dimension or gamma).
    pub spaces: Vec<SpaceSettings>,
    /// Sharpness of the codebook's shares to choose from.
    pub sharpness: Vec<f32>,
    /// Classifiers to choose from. The first of everything is kept unless another is better by more than one standard error.
    pub classifiers: Vec<ClassifierKind>,
    /// Whether the training clips' mirrors train too (people are left- and right-handed).
    pub mirror: bool,
    /// Folds of the choice inside the training subjects.
    pub inner_folds: usize,
}

impl Experiment {
    /// The default method with a linear SVC.
    pub fn codebook(space: SpaceSettings) -> Self {
        Self {
            spaces: vec![space],
            sharpness: vec![2.0, 1.0, 4.0],
            classifiers: vec![ClassifierKind::Svc(5.0), ClassifierKind::Svc(1.0)],
            mirror: true,
            inner_folds: 4,
        }
    }

    /// The thesis' method: 0/1 grids of several sizes, k nearest neighbours.
    pub fn thesis() -> Self {
        let space = |bins: [usize; 3]| SpaceSettings {
            pattern: PatternKind::Thesis(bins.to_vec()),
            ..SpaceSettings::thesis()
        };
        Self {
            spaces: vec![space([9, 9, 9]), space([15, 9, 9]), space([6, 6, 6])],
            sharpness: vec![1.0],
            classifiers: vec![ClassifierKind::Knn(1), ClassifierKind::Knn(3)],
            mirror: false,
            inner_folds: 4,
        }
    }
}

/// What came out.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Every view by itself, all views' answers counted together.
    pub each: Confusion,
    /// All views fused.
    pub fused: Confusion,
}

/// Why an evaluation could not be done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// Leaving one out needs two.
    #[error("leave-one-subject-out needs at least 3 subjects, the samples have {0}")]
    Subjects(usize),
    /// Views differ.
    #[error(
        "clip {clip} has {found} views, the first has {expected}: fused views need the same in all clips"
    )]
    Views {
        /// Index of the clip.
        clip: usize,
        /// Its views.
        found: usize,
        /// Views of the first clip.
        expected: usize,
    },
    /// A space could not be learned.
    #[error(transparent)]
    Embedding(#[from] EmbeddingError),
}

/// Names in order of first appearance in sorted order.
pub fn names<'a>(all: impl Iterator<Item = &'a String>) -> Vec<String> {
    all.cloned().collect::<BTreeSet<_>>().into_iter().collect()
}

/// Runs the experiment over all subjects. `change` alters the left-out subject's clips before they are recognised (speed, shuffling,
/// damage); training is never altered.
///
/// # Errors
/// See [`EvaluationError`].
pub fn leave_one_subject_out(
    clips: &[Clip],
    experiment: &Experiment,
    change: impl Fn(&Clip) -> Clip + Sync,
) -> Result<Outcome, EvaluationError> {
    let subjects = names(clips.iter().map(|clip| &clip.subject));
    let classes = names(clips.iter().map(|clip| &clip.activity));
    if subjects.len() < 3 {
        return Err(EvaluationError::Subjects(subjects.len()));
    }
    let views = clips[0].views.len();
    if let Some((clip, found)) = clips.iter().enumerate().find(|(_, clip)| clip.views.len() != views) {
        return Err(EvaluationError::Views { clip, found: found.views.len(), expected: views });
    }
    let folds: Result<Vec<Outcome>, EvaluationError> = subjects
        .par_iter()
        .map(|left_out| {
            let kept = clips.iter().filter(|clip| clip.subject != *left_out);
            let mirrors: Vec<Clip> =
                if experiment.mirror { kept.clone().map(Clip::mirrored).collect() } else { Vec::new() };
            let train: Vec<&Clip> = kept.chain(&mirrors).collect();
            let test: Vec<Clip> =
                clips.iter().filter(|clip| clip.subject == *left_out).map(&change).collect();
            one_fold(&train, &test.iter().collect::<Vec<_>>(), &classes, views, experiment)
        })
        .collect();
    let mut outcome = Outcome { each: Confusion::new(classes.clone()), fused: Confusion::new(classes) };
    for fold in folds? {
        outcome.each.add(&fold.each);
        outcome.fused.add(&fold.fused);
    }
    Ok(outcome)
}

/// A space and a sharpness with the patterns of training and test clips: `[clip][view]`.
struct Candidate {
    train: Vec<Vec<Array1<f32>>>,
    test: Vec<Vec<Array1<f32>>>,
}

fn one_fold(
    train: &[&Clip],
    test: &[&Clip],
    classes: &[String],
    views: usize,
    experiment: &Experiment,
) -> Result<Outcome, EvaluationError> {
    let label = |clip: &&Clip| classes.iter().position(|class| *class == clip.activity).unwrap_or(0);
    let (train_labels, test_labels): (Vec<usize>, Vec<usize>) =
        (train.iter().map(label).collect(), test.iter().map(label).collect());
    let train_subjects = names(train.iter().map(|clip| &clip.subject));
    let group: Vec<usize> = train
        .iter()
        .map(|clip| {
            train_subjects.iter().position(|s| *s == clip.subject).unwrap_or(0)
                % experiment.inner_folds.max(2)
        })
        .collect();
    let mut candidates = Vec::new();
    for settings in &experiment.spaces {
        let space = Space::train(train, settings)?;
        let vectors = |clips: &[&Clip]| -> Result<Vec<Vec<Array2<f32>>>, EmbeddingError> {
            clips.par_iter().map(|clip| clip.views.iter().map(|view| space.vectors(view)).collect()).collect()
        };
        let (train_vectors, test_vectors) = (vectors(train)?, vectors(test)?);
        for &sharpness in &experiment.sharpness {
            let patterns = |clips: &[Vec<Array2<f32>>]| -> Vec<Vec<Array1<f32>>> {
                clips
                    .par_iter()
                    .map(|views| views.iter().map(|v| space.pattern_of(v.view(), sharpness)).collect())
                    .collect()
            };
            candidates.push(Candidate { train: patterns(&train_vectors), test: patterns(&test_vectors) });
        }
    }
    let mut outcome =
        Outcome { each: Confusion::new(classes.to_vec()), fused: Confusion::new(classes.to_vec()) };
    let arrangements: Vec<Vec<usize>> =
        (0..views).map(|view| vec![view]).chain((views > 1).then(|| (0..views).collect())).collect();
    for chosen_views in &arrangements {
        let gathered = |clips: &[Vec<Array1<f32>>]| -> Array2<f32> {
            rows(&clips.iter().map(|views| joined(views, chosen_views)).collect::<Vec<_>>())
        };
        let mut best: Option<(u32, usize, ClassifierKind)> = None;
        // The first candidate stays unless another is better by more than chance explains (the one-standard-error rule).
        let mut first = 0;
        let single = candidates.len() * experiment.classifiers.len() == 1;
        for (index, candidate) in candidates.iter().enumerate() {
            let gram = if single { Array2::zeros((0, 0)) } else { products(&gathered(&candidate.train)) };
            for &kind in &experiment.classifiers {
                let right =
                    if single { 0 } else { inner_right(&gram, &train_labels, &group, classes.len(), kind) };
                if best.is_none_or(|(most, _, _)| right > most.max(first + doubt(first, train_labels.len())))
                {
                    if best.is_none() {
                        first = right;
                    }
                    best = Some((right, index, kind));
                }
            }
        }
        let Some((_, index, kind)) = best else { continue };
        let classifier =
            Classifier::train(kind, gathered(&candidates[index].train).view(), &train_labels, classes.len());
        let tested = gathered(&candidates[index].test);
        for (row, &truth) in tested.rows().into_iter().zip(&test_labels) {
            let answer = classifier.best(row).0;
            if chosen_views.len() == 1 {
                outcome.each.count(truth, answer);
            }
            if chosen_views.len() == views {
                outcome.fused.count(truth, answer);
            }
        }
    }
    Ok(outcome)
}

/// Standard error of a count of right answers, rounded up.
fn doubt(right: u32, of: usize) -> u32 {
    let share = f64::from(right) / of.max(1) as f64;
    (of as f64 * share * (1.0 - share)).max(0.0).sqrt().ceil() as u32
}

/// Products of all pairs of patterns.
fn products(patterns: &Array2<f32>) -> Array2<f32> {
    patterns.dot(&patterns.t())
}

/// The patterns of some views, one after the other.
pub(crate) fn joined(views: &[Array1<f32>], chosen: &[usize]) -> Array1<f32> {
    chosen.iter().flat_map(|&view| views[view].iter().copied()).collect()
}

/// Right answers of a classifier over the folds of training subjects, from the patterns' Gram matrix.
fn inner_right(
    gram: &Array2<f32>,
    labels: &[usize],
    group: &[usize],
    classes: usize,
    kind: ClassifierKind,
) -> u32 {
    let folds = group.iter().max().map_or(0, |most| most + 1);
    let best = |values: &[f32]| {
        values.iter().enumerate().fold(0, |best, (k, v)| if *v > values[best] { k } else { best })
    };
    (0..folds)
        .into_par_iter()
        .map(|fold| {
            let kept: Vec<usize> = (0..labels.len()).filter(|&i| group[i] != fold).collect();
            let held = (0..labels.len()).filter(|&i| group[i] == fold);
            match kind {
                ClassifierKind::Svc(c) => {
                    let svc = DualSvc::train(gram.view(), &kept, labels, classes, c);
                    held.filter(|&i| best(&svc.decide(gram.row(i)).to_vec()) == labels[i]).count() as u32
                }
                ClassifierKind::Knn(k) => held
                    .filter(|&i| {
                        let distances = kept.iter().map(|&j| (gram[[j, j]] - 2.0 * gram[[i, j]], labels[j]));
                        best(&knn::vote(distances.collect(), classes, k)) == labels[i]
                    })
                    .count() as u32,
            }
        })
        .sum()
}
