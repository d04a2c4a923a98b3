//! Cross-validation over training subjects. Spaces are learned once from all training clips (unsupervised). Classifiers
//! are trained and tested over folds of subjects on the Gram matrix. O(spaces x (clips^2 P + folds clips^2)).

use super::classifier::ClassifierKind;
use super::classifier::method::Fold;
use super::clip::Clip;
use super::experiment::Experiment;
use super::patterns::{gathered, patterns_of, vectors_of};
use super::space::{Galleries, Map, Space, SpaceSettings};
use super::watch::Watch;
use crate::embedding::EmbeddingError;
use ndarray::{Array1, Array2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Views {
    /// Each view separately.
    Each,
    /// All views as one pattern.
    #[default]
    Fused,
}

farnear_silhouettes::named!(Views, "views", "each" => Each, "fused" => Fused);

impl Views {
    /// Groups of views that form a pattern each.
    pub fn arrangements(self, views: usize) -> Vec<Vec<usize>> {
        match self {
            Self::Each => (0..views).map(|view| vec![view]).collect(),
            Self::Fused => vec![(0..views).collect()],
        }
    }
}

/// Result of cross-validation.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Space learned from all training clips.
    pub space: Space,
    /// Sharpness of soft assignments.
    pub sharpness: f32,
    pub classifier: ClassifierKind,
    /// Inner accuracy, 0 to 1; `None` without alternatives.
    pub inner_accuracy: Option<f64>,
    /// Patterns of the training clips, `[clip][view]`.
    pub patterns: Vec<Vec<Array1<f32>>>,
}

impl Chosen {
    /// Condition number of the RBF system, if any.
    pub fn condition(&self) -> Option<f64> {
        match &self.space.map {
            Map::Rbf(rbf) => Some(rbf.condition),
            Map::Pca(_) => None,
        }
    }
}

/// Sorted unique names.
pub fn names<'a>(all: impl Iterator<Item = &'a String>) -> Vec<String> {
    all.cloned().collect::<BTreeSet<_>>().into_iter().collect()
}

/// Selects space, sharpness and classifier for clips with equal views; labels index `classes`. Clips of classes
/// that the other folds lack do not count; without any other clip, the first values are used. One choice serves all
/// arrangements: their answers count together.
/// Fails if a space cannot be learned, or with [`EmbeddingError::Stopped`].
pub fn choose(
    clips: &[&Clip],
    classes: &[String],
    experiment: &Experiment,
    views: &[Views],
    watch: &dyn Watch,
) -> Result<Chosen, EmbeddingError> {
    let subjects = names(clips.iter().map(|clip| &clip.subject));
    let folds = experiment.inner_folds.clamp(2, subjects.len().max(2));
    let place = |names: &[String], name: &String| names.iter().position(|n| n == name).unwrap_or(0);
    let labels: Vec<usize> = clips.iter().map(|clip| place(classes, &clip.activity)).collect();
    let group: Vec<usize> = clips.iter().map(|clip| place(&subjects, &clip.subject) % folds).collect();
    let taught = |i: usize| (0..clips.len()).any(|j| labels[j] == labels[i] && group[j] != group[i]);
    let problem = Problem {
        clips,
        counted: (0..clips.len()).filter(|&i| taught(i)).collect(),
        labels,
        group,
        classes: classes.len(),
        folds,
        arrangements: {
            let seen = clips.first().map_or(0, |clip| clip.views.len());
            views.iter().flat_map(|views| views.arrangements(seen)).collect()
        },
        experiment,
        watch,
    };
    let mut galleries = Galleries::default();
    let single =
        experiment.sweeps.is_empty() && experiment.sharpness.len() * experiment.classifiers.len() == 1;
    let compare = !single && !problem.counted.is_empty();
    let mut best = problem.best_of(&experiment.space, &mut galleries, compare)?;
    if compare {
        for sweep in &experiment.sweeps {
            for settings in sweep.variants(&best.chosen.space.settings) {
                let found = problem.best_of(&settings, &mut galleries, true)?;
                if found.right > best.right {
                    best = found;
                }
            }
        }
        let of = problem.counted.len() * problem.arrangements.len();
        best.chosen.inner_accuracy = Some(best.right as f64 / of.max(1) as f64);
    }
    Ok(best.chosen)
}

struct Problem<'a> {
    clips: &'a [&'a Clip],
    labels: Vec<usize>,
    group: Vec<usize>,
    /// Clips that a fold of other subjects can name.
    counted: Vec<usize>,
    classes: usize,
    folds: usize,
    arrangements: Vec<Vec<usize>>,
    experiment: &'a Experiment,
    watch: &'a dyn Watch,
}

struct Candidate {
    right: usize,
    chosen: Chosen,
}

impl Problem<'_> {
    fn best_of(
        &self,
        settings: &SpaceSettings,
        galleries: &mut Galleries,
        compare: bool,
    ) -> Result<Candidate, EmbeddingError> {
        if self.watch.is_stopped() {
            return Err(EmbeddingError::Stopped);
        }
        let (space, vectors) = match &self.experiment.features {
            Some(space) => {
                let space = space.with_features(self.clips)?;
                let vectors = vectors_of(&space, self.clips)?;
                (space, vectors)
            }
            None => galleries.space(self.clips, settings)?,
        };
        let mut best: Option<Candidate> = None;
        for &sharpness in &self.experiment.sharpness {
            let patterns = patterns_of(&space, &vectors, sharpness);
            let product = |chosen: &Vec<usize>| {
                let rows = gathered(&patterns, chosen);
                rows.dot(&rows.t())
            };
            let grams: Vec<Array2<f32>> =
                if compare { self.arrangements.iter().map(product).collect() } else { Vec::new() };
            // The first of equals, independent of the order of values.
            let scored = self.experiment.classifiers.iter().map(|&kind| {
                let right: usize = grams.iter().map(|gram| self.right(gram, kind)).sum();
                (right, kind)
            });
            let won = scored.reduce(|best, next| if next.0 > best.0 { next } else { best });
            let Some((right, classifier)) = won else { continue };
            if best.as_ref().is_none_or(|best| right > best.right) {
                let space = space.clone();
                let chosen = Chosen { space, sharpness, classifier, inner_accuracy: None, patterns };
                best = Some(Candidate { right, chosen });
            }
        }
        self.watch.space_tried();
        best.ok_or(EmbeddingError::Shape {
            what: "number of classifiers and sharpnesses to choose from",
            expected: 1,
            found: 0,
        })
    }

    fn right(&self, gram: &Array2<f32>, kind: ClassifierKind) -> usize {
        (0..self.folds)
            .into_par_iter()
            .map(|fold| {
                let kept: Vec<usize> = (0..self.labels.len()).filter(|&i| self.group[i] != fold).collect();
                let held: Vec<usize> =
                    self.counted.iter().copied().filter(|&i| self.group[i] == fold).collect();
                let (gram, labels) = (gram.view(), self.labels.as_slice());
                kind.right(&Fold { gram, kept: &kept, held: &held, labels, classes: self.classes })
            })
            .sum()
    }
}
