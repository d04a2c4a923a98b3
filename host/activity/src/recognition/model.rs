//! A trained recogniser as one value; [`super::model_file`] saves and reads it.

use super::classifier::{Classifier, ClassifierKind};
use super::clip::{Clip, Track};
use super::frames::Mode;
use super::occupancy::rows;
use super::space::{Map, Pattern, Space, SpaceSettings};
use crate::embedding::EmbeddingError;
use crate::embedding::descriptor::Scaling;
use crate::evaluation::choice::{Chosen, Views, choose, joined, names};
use crate::evaluation::experiment::Experiment;
use ndarray::{Array1, Array2, ArrayView1};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Everything that is chosen for a recogniser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecogniserSettings {
    /// How masks are scaled before they are described.
    pub scaling: Scaling,
    /// How frames are embedded and clips become patterns.
    pub space: SpaceSettings,
    /// Sharpness of the codebook's shares.
    pub sharpness: f32,
    /// Classifier.
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
    /// The classifier.
    pub classifier: Classifier,
    /// Squared distance to the nearest training pattern beyond which a clip is unknown.
    pub far: f32,
    /// Training patterns, against which strangeness is measured.
    pub patterns: Array2<f32>,
    /// Frames of a training clip, median: what a window over a long recording should hold.
    pub typical_frames: usize,
}

/// What was recognised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The activity, `None` = unknown: too far from all training data, or nothing to see.
    pub activity: Option<String>,
    /// Share of the best activity, 0 to 1.
    pub confidence: f32,
    /// Share of every activity.
    pub shares: Vec<(String, f32)>,
    /// Squared distance to the nearest training pattern over the distance beyond which nothing is known: above 1 is unknown.
    pub strangeness: f32,
}

/// Why a model could not be made, read or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// Not a model.
    #[error("not a farnear activity model: {0}")]
    NotAModel(&'static str),
    /// Another version.
    #[error("the model has {what} version {found}, this program reads {expected}: train it again")]
    Version {
        /// Which version.
        what: &'static str,
        /// In the file.
        found: u32,
        /// Expected.
        expected: u32,
    },
    /// Damaged.
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
    /// Trains on clips that all have the same views, with settings as they are.
    ///
    /// # Errors
    /// Fewer than two activities, clips with other views, a gallery that cannot be laid out.
    pub fn train(clips: &[Clip], settings: &RecogniserSettings) -> Result<Self, ModelError> {
        let experiment = Experiment {
            space: settings.space.clone(),
            sweeps: Vec::new(),
            sharpness: vec![settings.sharpness],
            classifiers: vec![settings.classifier],
            mirror: settings.mirror,
            inner_folds: 2,
        };
        Self::train_searched(clips, &experiment, settings.scaling).map(|(recogniser, _)| recogniser)
    }

    /// Trains with settings chosen by cross-validation over the clips' subjects; gives the accuracy over the folds beside it (0 to
    /// 1, of the chosen settings and so a little too good), `None` where nothing was compared: one subject, or one of everything.
    ///
    /// # Errors
    /// As [`Self::train`].
    pub fn train_searched(
        clips: &[Clip],
        experiment: &Experiment,
        scaling: Scaling,
    ) -> Result<(Self, Option<f64>), ModelError> {
        let activities = names(clips.iter().map(|clip| &clip.activity));
        if activities.len() < 2 {
            return Err(ModelError::Activities(activities.len()));
        }
        let (views, boxes) = shape(&clips[0]);
        if views == 0 {
            return Err(ModelError::Clip {
                found: 0,
                found_boxes: false,
                expected: 1,
                expected_boxes: false,
            });
        }
        for clip in clips {
            fits(clip, views, boxes)?;
        }
        let mirrors: Vec<Clip> =
            if experiment.mirror { clips.iter().map(Clip::mirrored).collect() } else { Vec::new() };
        let all: Vec<&Clip> = clips.iter().chain(&mirrors).collect();
        let Chosen { space, sharpness, classifier: kind, inner_accuracy, patterns } =
            choose(&all, &activities, experiment, &[Views::Fused])?;
        let order: Vec<usize> = (0..views).collect();
        let patterns = rows(&patterns.iter().map(|of_views| joined(of_views, &order)).collect::<Vec<_>>());
        let labels: Vec<usize> =
            all.iter().map(|clip| activities.iter().position(|a| *a == clip.activity).unwrap_or(0)).collect();
        let mut lengths: Vec<usize> = clips.iter().map(|clip| clip.views[0].frames()).collect();
        lengths.sort_unstable();
        let recogniser = Self {
            typical_frames: lengths[lengths.len() / 2],
            far: unknown_beyond(&space, &all, clips.len(), &patterns, sharpness)?,
            settings: RecogniserSettings {
                scaling,
                space: space.settings.clone(),
                sharpness,
                classifier: kind,
                mirror: experiment.mirror,
            },
            classifier: Classifier::train(kind, patterns.view(), &labels, activities.len()),
            activities,
            views,
            space,
            patterns,
        };
        Ok((recogniser, inner_accuracy))
    }

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
            let shares = self.activities.iter().map(|a| (a.clone(), 0.0)).collect();
            return Ok(Answer { activity: None, confidence: 0.0, shares, strangeness: f32::INFINITY });
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
        let shares = self.classifier.shares(pattern.view());
        let (best, confidence) = self.classifier.best(pattern.view());
        let strangeness = nearest(self.patterns.rows().into_iter(), &pattern) / self.far.max(1e-9);
        Ok(Answer {
            activity: (strangeness <= 1.0).then(|| self.activities[best].clone()),
            confidence,
            shares: self.activities.iter().cloned().zip(shares).collect(),
            strangeness,
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

/// Views of a clip and whether they have box motion.
fn shape(clip: &Clip) -> (usize, bool) {
    (clip.views.len(), clip.views.iter().all(|view| view.boxes.is_some()))
}

fn fits(clip: &Clip, expected: usize, expected_boxes: bool) -> Result<(), ModelError> {
    let (found, found_boxes) = shape(clip);
    if (found, found_boxes) == (expected, expected_boxes) {
        return Ok(());
    }
    Err(ModelError::Clip { found, found_boxes, expected, expected_boxes })
}

/// All views' patterns, one after the other.
fn pattern(space: &Space, views: &[Track], sharpness: f32) -> Result<Array1<f32>, ModelError> {
    let patterns: Result<Vec<Array1<f32>>, EmbeddingError> =
        views.iter().map(|view| Ok(space.pattern_of(space.vectors(view)?.view(), sharpness))).collect();
    let patterns = patterns?;
    Ok(joined(&patterns, &(0..patterns.len()).collect::<Vec<_>>()))
}

/// Squared distance to the nearest of some patterns.
fn nearest<'a>(patterns: impl Iterator<Item = ArrayView1<'a, f32>>, query: &Array1<f32>) -> f32 {
    patterns
        .map(|row| row.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum())
        .fold(f32::INFINITY, f32::min)
}

/// Share of what was trained on that must count as known when somebody new does it.
const KNOWN: f64 = 0.99;

/// Beyond this squared distance to every training pattern nothing is known. Whole clips and their halves (a running answer has seen a
/// part only) are compared with all other subjects' patterns, as somebody new would be; with a single subject, with their
/// other clips. `clips` are followed by their mirrors, if those train too, and `patterns` are in the same order.
fn unknown_beyond(
    space: &Space,
    clips: &[&Clip],
    originals: usize,
    patterns: &Array2<f32>,
    sharpness: f32,
) -> Result<f32, ModelError> {
    let alone = clips.iter().all(|clip| clip.subject == clips[0].subject);
    let apart: Result<Vec<Vec<f32>>, ModelError> = (0..originals)
        .into_par_iter()
        .map(|i| {
            let clip = clips[i];
            let other = |j: usize| if alone { j % originals != i } else { clips[j].subject != clip.subject };
            let others =
                || patterns.rows().into_iter().enumerate().filter(|(j, _)| other(*j)).map(|(_, row)| row);
            let half = clip.views.iter().map(Track::frames).min().unwrap_or(0).div_ceil(2);
            let mut found = vec![nearest(others(), &patterns.row(i).to_owned())];
            for part in clip.windows(half) {
                found.push(nearest(others(), &pattern(space, &part.views, sharpness)?));
            }
            Ok(found)
        })
        .collect();
    let mut apart: Vec<f32> = apart?.into_iter().flatten().filter(|d| d.is_finite()).collect();
    apart.sort_by(f32::total_cmp);
    let place = (KNOWN * apart.len().saturating_sub(1) as f64).round() as usize;
    Ok(apart.get(place).copied().unwrap_or(f32::INFINITY))
}
