//! A trained recogniser and its answers; [`super::training`] makes it, [`super::model_file`] saves and reads it.

use super::auxiliary_model::AuxiliaryModel;
use super::classifier::softmax::softmax;
use super::classifier::{Classifier, ClassifierKind, largest};
use super::clip::Track;
use super::frames::Mode;
use super::lengths::Lengths;
use super::patterns::joined;
use super::self_training::{Labelled, self_trained};
use super::space::{Map, Pattern, Space, SpaceSettings};
use super::unknown::Limits;
use crate::embedding::{EmbeddingError, descriptor::Scaling, squared_distance};
use ndarray::{Array1, Array2, ArrayView1};
use serde::{Deserialize, Serialize};

/// How a [`Recogniser`] is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecogniserSettings {
    pub scaling: Scaling,
    pub space: SpaceSettings,
    pub sharpness: f32,
    pub classifier: ClassifierKind,
    /// Also train on mirrored clips.
    pub mirror: bool,
}

impl Default for RecogniserSettings {
    fn default() -> Self {
        Self {
            scaling: Scaling::default(),
            space: SpaceSettings::default(),
            sharpness: 2.0,
            classifier: ClassifierKind::Svc(5.0),
            mirror: true,
        }
    }
}

/// Recognises the activity of a clip from the pattern of its frames in a learned space.
#[derive(Clone, Debug, PartialEq)]
pub struct Recogniser {
    pub settings: RecogniserSettings,
    /// Activities by class index.
    pub activities: Vec<String>,
    pub views: usize,
    pub space: Space,
    pub classifier: Classifier,
    /// Limits of the squared distance to the nearest of [`Self::patterns`], or without patterns of the entropy
    /// of the probabilities, nats; used without an auxiliary model.
    pub limits: Limits,
    /// Training patterns, or prototypes of them; the outlier score is measured from the nearest. Empty for
    /// networks, whose probabilities separate unknown clips better than distances do.
    pub patterns: Array2<f32>,
    /// Class of each of [`Self::patterns`] if they are training clips; empty for networks.
    pub labels: Vec<usize>,
    /// Auxiliary model for unknown clips and windows.
    pub second: Option<AuxiliaryModel>,
    /// Median frames of a training clip, the suggested window length.
    pub typical_frames: usize,
    /// Clip lengths by class.
    pub lengths: Vec<Lengths>,
    /// Classes that are answered; empty for all. Not part of a model file.
    pub among: Vec<usize>,
}

/// Answer for a clip, with all probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Activity; `None` = unknown or nothing to see.
    pub activity: Option<String>,
    /// Probability of the best activity, 0 to 1.
    pub confidence: f32,
    /// Probability of every activity.
    pub probabilities: Vec<(String, f32)>,
    /// Distance from the training data over the activity's limit: above 1 is unknown.
    pub outlier_score: f32,
}

impl Answer {
    fn without_person<'a>(activities: impl Iterator<Item = &'a String>) -> Self {
        let probabilities = activities.map(|activity| (activity.clone(), 0.0)).collect();
        Self { activity: None, confidence: 0.0, probabilities, outlier_score: f32::INFINITY }
    }

    /// Joint answer of several views: geometric mean of probabilities, mean outlier score.
    pub(super) fn joint(answers: &[Self]) -> Self {
        let n = answers.len().max(1) as f32;
        let mut values: Vec<f32> = (0..answers[0].probabilities.len())
            .map(|k| answers.iter().map(|answer| answer.probabilities[k].1.max(1e-9).ln()).sum::<f32>() / n)
            .collect();
        softmax(&mut values);
        let names = answers[0].probabilities.iter().map(|(name, _)| name.clone());
        let outlier_score = answers.iter().map(|answer| answer.outlier_score).sum::<f32>() / n;
        Self::of(names.zip(values).collect(), outlier_score)
    }

    /// Restricts the answer to some activities; their probabilities sum to 1.
    #[must_use]
    pub fn among(&self, activities: &[String]) -> Self {
        let mut kept: Vec<(String, f32)> =
            self.probabilities.iter().filter(|(name, _)| activities.contains(name)).cloned().collect();
        let total: f32 = kept.iter().map(|(_, share)| share).sum();
        kept.iter_mut().for_each(|(_, share)| *share /= total.max(f32::MIN_POSITIVE));
        Self::of(kept, self.outlier_score)
    }

    /// Most probable activity (the first of equals), also if unknown.
    pub fn best(&self) -> Option<&String> {
        most_probable(&self.probabilities).map(|(name, _)| name)
    }

    fn of(probabilities: Vec<(String, f32)>, outlier_score: f32) -> Self {
        let best = most_probable(&probabilities);
        let (activity, confidence) = best.map_or((None, 0.0), |(name, share)| (Some(name.clone()), *share));
        Self { activity: activity.filter(|_| outlier_score <= 1.0), confidence, probabilities, outlier_score }
    }
}

/// Shannon entropy, nats.
pub(super) fn entropy(probabilities: impl Iterator<Item = f32>) -> f32 {
    probabilities.filter(|p| *p > 0.0).map(|p| -p * p.ln()).sum()
}

fn most_probable(probabilities: &[(String, f32)]) -> Option<&(String, f32)> {
    probabilities.iter().fold(None, |best, next| match best {
        Some((_, share)) if *share >= next.1 => best,
        _ => Some(next),
    })
}

/// Why a model could not be made, read or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    #[error("not a farnear activity model: {0}")]
    NotAModel(&'static str),
    #[error("the model has {what} version {found}, this program reads {expected}: train it again")]
    Version {
        /// `format` or `descriptor`.
        what: &'static str,
        found: u32,
        expected: u32,
    },
    #[error("the model is damaged: checksum {found:#010x}, expected {expected:#010x}")]
    Checksum { found: u32, expected: u32 },
    #[error("the model's body cannot be read: {0}")]
    Body(String),
    #[error("the model's parts are inconsistent: {0}")]
    Parts(&'static str),
    #[error("the clip has {found} views{boxes}, the model was trained on {expected}{expected_boxes}", boxes = with(*.found_boxes), expected_boxes = with(*.expected_boxes))]
    Clip { found: usize, found_boxes: bool, expected: usize, expected_boxes: bool },
    #[error(
        "the model contains no training clips, which adaptation needs (the shipped models contain none, because adaptation made them \
         worse): train one on labelled samples, with this model's features if they are few"
    )]
    Unlabelled,
    #[error("the model's auxiliary model: {0}")]
    Second(Box<ModelError>),
    #[error("a model needs clips of at least two activities, found {0}")]
    Activities(usize),
    #[error(transparent)]
    Embedding(#[from] EmbeddingError),
}

fn with(boxes: bool) -> &'static str {
    if boxes { " of full frames" } else { " of cut-out silhouettes" }
}

impl Recogniser {
    /// Recognises one clip. A model of one view joins the answers of all views that see a person. Fails for
    /// views that the model does not accept, or cropped silhouettes where it needs full frames.
    pub fn recognise(&self, views: &[Track]) -> Result<Answer, ModelError> {
        self.check(views)?;
        let answers = self
            .groups(views)
            .iter()
            .map(|group| Ok(self.answer(self.pattern(group)?.view())))
            .collect::<Result<Vec<Answer>, ModelError>>()?;
        let answer = self.joint(&answers);
        if answers.is_empty() {
            return Ok(answer);
        }
        let Some(second) = &self.second else { return Ok(answer) };
        let Some(class) = self.activities.iter().position(|activity| Some(activity) == answer.best()) else {
            return Ok(answer);
        };
        let outlier_score = second.outlier_score(&second.recogniser.recognise(views)?, class);
        Ok(Answer::of(answer.probabilities, outlier_score))
    }

    /// Whether the model was trained on these views; for a model of one view, on any of them. `false` for a model without
    /// training clips, and for the thesis' grid, where different clips have equal patterns. Fails as [`Self::recognise`].
    pub fn has_learned(&self, views: &[Track]) -> Result<bool, ModelError> {
        /// Of squared distances; patterns are about 1 long.
        const ROUNDING: f32 = 1e-8;
        self.check(views)?;
        if self.patterns.is_empty() || matches!(self.space.pattern, Pattern::Thesis(_)) {
            return Ok(false);
        }
        for group in self.groups(views) {
            if self.distance(self.pattern(&group)?.view()) < ROUNDING {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Answers with some of the activities only, and measures the outlier score for these. Unknown names are ignored;
    /// an empty list restricts nothing.
    #[must_use]
    pub fn restricted_to(&self, activities: &[String]) -> Self {
        let is_kept = |class: &usize| activities.contains(&self.activities[*class]);
        Self { among: (0..self.activities.len()).filter(is_kept).collect(), ..self.clone() }
    }

    /// Classes that are answered.
    fn answered(&self) -> Vec<usize> {
        if self.among.is_empty() { (0..self.activities.len()).collect() } else { self.among.clone() }
    }

    pub(super) fn check(&self, views: &[Track]) -> Result<(), ModelError> {
        let boxes = self.uses_boxes();
        let found_boxes = views.iter().all(|view| view.boxes.is_some());
        let any_view = self.views == 1 && views.len() > 1;
        if !(views.len() == self.views || any_view) || (boxes && !found_boxes) {
            return Err(ModelError::Clip {
                found: views.len(),
                found_boxes,
                expected: self.views,
                expected_boxes: boxes,
            });
        }
        Ok(())
    }

    /// Views with an answer of their own; those without a person are omitted.
    pub(super) fn groups(&self, views: &[Track]) -> Vec<Vec<Track>> {
        let mut groups = self.opinions(views);
        groups.retain(|group| group.iter().any(|view| view.frames() > 0));
        groups
    }

    /// [`Self::groups`], and for a network each view's mirror.
    pub(super) fn opinions(&self, views: &[Track]) -> Vec<Vec<Track>> {
        if self.views > 1 {
            return vec![views.to_vec()];
        }
        // A network is trained on mirrors too, so the mirror's answer counts as well.
        let mirrors = matches!(self.space.pattern, Pattern::Network(_) | Pattern::Features(_));
        let both = |view: &Track| std::iter::once(view.clone()).chain(mirrors.then(|| view.mirrored()));
        views.iter().flat_map(both).map(|view| vec![view]).collect()
    }

    /// The joint answer of several views; empty means that no person is visible.
    pub(super) fn joint(&self, answers: &[Answer]) -> Answer {
        match answers {
            [] => Answer::without_person(self.answered().into_iter().map(|class| &self.activities[class])),
            [one] => one.clone(),
            several => {
                let joint = Answer::joint(several);
                let outlier_score = self.entropy_score(&joint.probabilities).unwrap_or(joint.outlier_score);
                Answer::of(joint.probabilities, outlier_score)
            }
        }
    }

    /// The outlier score of an answer if the model lacked this activity; `None` for models that measure distances.
    pub fn outlier_score_without(&self, answer: &Answer, activity: &str) -> Option<f32> {
        let others: Vec<String> = self.activities.iter().filter(|name| *name != activity).cloned().collect();
        self.entropy_score(&answer.among(&others).probabilities)
    }

    /// Entropy over its limit, which all activities of a network share; `None` with patterns. The limit of a few
    /// activities is lower by the ratio of the largest possible entropies.
    fn entropy_score(&self, probabilities: &[(String, f32)]) -> Option<f32> {
        let nats = entropy(probabilities.iter().map(|(_, probability)| *probability));
        let largest = |classes: usize| (classes as f32).ln();
        let lower = match self.among.len() {
            0 => 1.0,
            // A single answer is certain.
            1 => return Some(0.0).filter(|_| self.patterns.nrows() == 0),
            few => largest(few) / largest(self.activities.len()),
        };
        (self.patterns.nrows() == 0).then(|| self.limits.score(0, nats) / lower)
    }

    pub(super) fn answer(&self, pattern: ArrayView1<f32>) -> Answer {
        self.answer_by(pattern, self.distance(pattern))
    }

    pub(super) fn answer_by(&self, pattern: ArrayView1<f32>, squared_distance: f32) -> Answer {
        let all = self.classifier.probabilities(pattern);
        let classes = self.answered();
        let kept: Vec<f32> = classes.iter().map(|&class| all[class]).collect();
        let best = classes.get(largest(&kept).0).copied().unwrap_or(0);
        let total = if self.among.is_empty() { 1.0 } else { kept.iter().sum::<f32>().max(f32::MIN_POSITIVE) };
        let names = classes.iter().map(|&class| self.activities[class].clone());
        let probabilities: Vec<(String, f32)> = names.zip(kept.iter().map(|share| share / total)).collect();
        let outlier_score =
            self.entropy_score(&probabilities).unwrap_or_else(|| self.limits.score(best, squared_distance));
        Answer::of(probabilities, outlier_score)
    }

    pub(super) fn pattern(&self, views: &[Track]) -> Result<Array1<f32>, ModelError> {
        if self.uses_boxes() || views.iter().all(|view| view.boxes.is_none()) {
            return pattern(&self.space, views, self.settings.sharpness);
        }
        let shapes: Vec<Track> = views.iter().map(|view| Track { boxes: None, ..view.clone() }).collect();
        pattern(&self.space, &shapes, self.settings.sharpness)
    }

    /// The recogniser adapted to unlabelled clips from another camera, sensor or laboratory
    /// ([`super::self_training`]); unknown limits are unchanged. Fails for clips that do not fit.
    pub fn adapted(&self, clips: &[Vec<Track>], rounds: usize) -> Result<Self, ModelError> {
        if self.labels.is_empty() || self.labels.len() != self.patterns.nrows() {
            return Err(ModelError::Unlabelled);
        }
        let mut rows = Vec::new();
        for views in clips {
            self.check(views)?;
            for group in self.groups(views) {
                rows.push(self.pattern(&group)?);
            }
        }
        let others = Array2::from_shape_fn((rows.len(), self.patterns.ncols()), |(i, k)| rows[i][k]);
        let labelled =
            Labelled { patterns: self.patterns.view(), labels: &self.labels, classes: self.activities.len() };
        Ok(Self {
            classifier: self_trained(self.settings.classifier, labelled, others.view(), rounds),
            ..self.clone()
        })
    }

    pub(super) fn distance(&self, pattern: ArrayView1<f32>) -> f32 {
        nearest(self.patterns.rows().into_iter(), pattern)
    }

    /// Whether the features include the box's motion.
    pub fn uses_boxes(&self) -> bool {
        let dimensions = match &self.space.map {
            Map::Rbf(rbf) => rbf.dimensions(),
            Map::Pca(pca) => pca.directions.nrows(),
        };
        let repeats = if self.settings.space.mode == Mode::Ordered { 3 } else { 2 };
        match &self.space.pattern {
            Pattern::Thesis(_) => false,
            Pattern::Codebook(book) => book.centres.ncols() > repeats * dimensions,
            Pattern::Network(network) => network.mean.len() > repeats * dimensions,
            Pattern::Features(features) => features.network.mean.len() > repeats * dimensions,
        }
    }
}

pub(super) fn pattern(space: &Space, views: &[Track], sharpness: f32) -> Result<Array1<f32>, ModelError> {
    let patterns: Result<Vec<Array1<f32>>, EmbeddingError> =
        views.iter().map(|view| Ok(space.pattern_of(space.vectors(view)?.view(), sharpness))).collect();
    let patterns = patterns?;
    Ok(joined(&patterns, &(0..patterns.len()).collect::<Vec<_>>()))
}

pub(super) fn nearest<'a>(
    patterns: impl Iterator<Item = ArrayView1<'a, f32>>,
    query: ArrayView1<f32>,
) -> f32 {
    patterns.map(|row| squared_between(row, query)).fold(f32::INFINITY, f32::min)
}

pub(super) fn squared_between(a: ArrayView1<f32>, b: ArrayView1<f32>) -> f32 {
    match (a.as_slice(), b.as_slice()) {
        (Some(a), Some(b)) => squared_distance(a, b),
        _ => a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum(),
    }
}
