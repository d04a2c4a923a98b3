//! A trained recogniser as one value, and what it answers; [`super::training`] makes it, [`super::model_file`] saves and reads it.

use super::classifier::{Classifier, ClassifierKind};
use super::clip::Track;
use super::frames::Mode;
use super::patterns::joined;
use super::space::{Map, Pattern, Space, SpaceSettings};
use crate::embedding::EmbeddingError;
use crate::embedding::descriptor::Scaling;
use ndarray::{Array1, Array2, ArrayView1};
use serde::{Deserialize, Serialize};

/// Everything that is chosen for a recogniser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecogniserSettings {
    /// How masks are scaled before they are described.
    pub scaling: Scaling,
    /// How frames are embedded and clips become patterns.
    pub space: SpaceSettings,
    /// Sharpness of the codebook's soft assignments.
    pub sharpness: f32,
    /// Which classifier, with its parameter.
    pub classifier: ClassifierKind,
    /// Whether the training clips' mirrors train too.
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

/// A trained recogniser.
#[derive(Clone, Debug, PartialEq)]
pub struct Recogniser {
    /// How it was trained.
    pub settings: RecogniserSettings,
    /// Activities by class.
    pub activities: Vec<String>,
    /// Views that are fused, in order.
    pub views: usize,
    /// The learned space.
    pub space: Space,
    /// The classifier, trained on the patterns.
    pub classifier: Classifier,
    /// Squared distance to the nearest training pattern beyond which a clip is unknown.
    pub far: f32,
    /// Training patterns, from whose nearest the outlier score is measured.
    pub patterns: Array2<f32>,
    /// Frames of a training clip, median: what a window over a long recording should hold.
    pub typical_frames: usize,
}

/// An activity, and how sure that is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The activity, `None` = unknown: too far from all training data, or nothing to see.
    pub activity: Option<String>,
    /// Probability of the best activity, 0 to 1.
    pub confidence: f32,
    /// Probability of every activity.
    pub probabilities: Vec<(String, f32)>,
    /// Squared distance to the nearest training pattern over the largest at which an activity still counts as known: above 1 is
    /// unknown.
    pub outlier_score: f32,
}

/// Why a model could not be made, read or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// Not a model.
    #[error("not a farnear activity model: {0}")]
    NotAModel(&'static str),
    /// Made by another version of the program.
    #[error("the model has {what} version {found}, this program reads {expected}: train it again")]
    Version {
        /// The part of the file that has versions: format or descriptor.
        what: &'static str,
        /// In the file.
        found: u32,
        /// Read by this program.
        expected: u32,
    },
    /// Some of the body's bytes have changed.
    #[error("the model is damaged: checksum {found:#010x}, expected {expected:#010x}")]
    Checksum {
        /// Of the body.
        found: u32,
        /// In the header.
        expected: u32,
    },
    /// The body cannot be read.
    #[error("the model's body cannot be read: {0}")]
    Body(String),
    /// The parts of the body do not belong together.
    #[error("the model's parts do not belong together: {0}")]
    Parts(&'static str),
    /// The clip does not fit the model.
    #[error("the clip has {found} views{boxes}, the model was trained on {expected}{expected_boxes}", boxes = with(*.found_boxes), expected_boxes = with(*.expected_boxes))]
    Clip {
        /// Views of the clip.
        found: usize,
        /// Whether it has box motion.
        found_boxes: bool,
        /// Views of the model.
        expected: usize,
        /// Whether the model uses box motion.
        expected_boxes: bool,
    },
    /// Nothing to train on.
    #[error("a model needs clips of at least two activities, found {0}")]
    Activities(usize),
    /// A space could not be learned or used.
    #[error(transparent)]
    Embedding(#[from] EmbeddingError),
}

fn with(boxes: bool) -> &'static str {
    if boxes { " of full frames" } else { " of cut-out silhouettes" }
}

impl Recogniser {
    /// Recognises one clip.
    ///
    /// # Errors
    /// A clip with other views than the model's, or with cut-out silhouettes where the model knows full frames.
    pub fn recognise(&self, views: &[Track]) -> Result<Answer, ModelError> {
        let boxes = self.uses_boxes();
        let found_boxes = views.iter().all(|view| view.boxes.is_some());
        if views.len() != self.views || (boxes && !found_boxes) {
            return Err(ModelError::Clip {
                found: views.len(),
                found_boxes,
                expected: self.views,
                expected_boxes: boxes,
            });
        }
        if views.iter().all(|view| view.frames() == 0) {
            let probabilities = self.activities.iter().map(|a| (a.clone(), 0.0)).collect();
            return Ok(Answer {
                activity: None,
                confidence: 0.0,
                probabilities,
                outlier_score: f32::INFINITY,
            });
        }
        // A model of cut-out silhouettes looks at shapes only, also in full frames.
        let shapes: Vec<Track>;
        let views = if boxes || !found_boxes {
            views
        } else {
            shapes = views.iter().map(|view| Track { boxes: None, ..view.clone() }).collect();
            &shapes
        };
        let pattern = pattern(&self.space, views, self.settings.sharpness)?;
        let probabilities = self.classifier.probabilities(pattern.view());
        let (best, confidence) = self.classifier.best(pattern.view());
        let outlier_score = nearest(self.patterns.rows().into_iter(), &pattern) / self.far.max(1e-9);
        Ok(Answer {
            activity: (outlier_score <= 1.0).then(|| self.activities[best].clone()),
            confidence,
            probabilities: self.activities.iter().cloned().zip(probabilities).collect(),
            outlier_score,
        })
    }

    /// Whether the box's motion is part of what was learned.
    pub fn uses_boxes(&self) -> bool {
        match (&self.space.pattern, &self.space.map) {
            (Pattern::Thesis(_), _) => false,
            (Pattern::Codebook(book), map) => {
                let dimensions = match map {
                    Map::Rbf(rbf) => rbf.dimensions(),
                    Map::Pca(pca) => pca.directions.nrows(),
                };
                let repeats = if self.settings.space.mode == Mode::Ordered { 3 } else { 2 };
                book.centres.ncols() > repeats * dimensions
            }
        }
    }
}

/// All views' patterns, one after the other.
pub(super) fn pattern(space: &Space, views: &[Track], sharpness: f32) -> Result<Array1<f32>, ModelError> {
    let patterns: Result<Vec<Array1<f32>>, EmbeddingError> =
        views.iter().map(|view| Ok(space.pattern_of(space.vectors(view)?.view(), sharpness))).collect();
    let patterns = patterns?;
    Ok(joined(&patterns, &(0..patterns.len()).collect::<Vec<_>>()))
}

/// Squared distance to the nearest of some patterns.
pub(super) fn nearest<'a>(patterns: impl Iterator<Item = ArrayView1<'a, f32>>, query: &Array1<f32>) -> f32 {
    patterns
        .map(|row| row.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum())
        .fold(f32::INFINITY, f32::min)
}
