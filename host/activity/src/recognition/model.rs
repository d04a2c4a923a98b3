//! A trained recogniser as one value, saved and read as bytes with a version and a checksum.
//!
//! File: the 8 bytes `farnearA`, format version (u32), descriptor version (u32), length of the body (u64), CRC-32 of the body (u32), all
//! little-endian, then the body (postcard). Anything that does not fit is refused by name, never guessed.

use super::classifier::{Classifier, ClassifierKind};
use super::clip::{Clip, Track};
use super::codebook::Codebook;
use super::occupancy::{OccupancyGrid, rows};
use super::space::{Map, Pattern, Space, SpaceSettings};
use crate::embedding::EmbeddingError;
use crate::embedding::descriptor::{DESCRIPTOR_VERSION, Scaling};
use crate::embedding::pca::Pca;
use crate::embedding::rbf::Rbf;
use crate::evaluation::leave_one_out::{joined, names};
use ndarray::{Array1, Array2};
use serde::{Deserialize, Serialize};

/// Version of the file's format.
pub const FORMAT_VERSION: u32 = 1;
const MAGIC: &[u8; 8] = b"farnearA";
const HEADER: usize = 28;

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
    /// Training frames' distances to the gallery: 99th percentile of the embedded frames' squared distance to their nearest pattern neighbour.
    pub far: f32,
    /// Training patterns, against which strangeness is measured.
    pub patterns: Array2<f32>,
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
    /// The body does not hold together.
    #[error("the model's body cannot be read: {0}")]
    Body(String),
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

/// The body of a file: plain values only.
#[derive(Serialize, Deserialize)]
struct Body {
    settings: RecogniserSettings,
    activities: Vec<String>,
    views: usize,
    map: SavedMap,
    spread: f32,
    neighbours: usize,
    pattern: SavedPattern,
    classifier: Classifier,
    far: f32,
    patterns: Array2<f32>,
}

#[derive(Serialize, Deserialize)]
enum SavedMap {
    Rbf { centres: Array2<f32>, weights: Array2<f32>, gamma: f32, ridge: f64, condition: f64 },
    Pca { mean: Array1<f32>, directions: Array2<f32>, variances: Vec<f64> },
}

#[derive(Serialize, Deserialize)]
enum SavedPattern {
    Thesis(OccupancyGrid),
    Codebook(Codebook),
}

impl Recogniser {
    /// Trains on clips that all have the same views.
    ///
    /// # Errors
    /// Fewer than two activities, clips with other views, a gallery that cannot be laid out.
    pub fn train(clips: &[Clip], settings: &RecogniserSettings) -> Result<Self, ModelError> {
        let activities = names(clips.iter().map(|clip| &clip.activity));
        if activities.len() < 2 {
            return Err(ModelError::Activities(activities.len()));
        }
        let (views, boxes) = shape(&clips[0]);
        for clip in clips {
            fits(clip, views, boxes)?;
        }
        let mirrors: Vec<Clip> =
            if settings.mirror { clips.iter().map(Clip::mirrored).collect() } else { Vec::new() };
        let all: Vec<&Clip> = clips.iter().chain(&mirrors).collect();
        let space = Space::train(&all, &settings.space)?;
        let found: Result<Vec<Array1<f32>>, ModelError> =
            all.iter().map(|clip| pattern(&space, &clip.views, settings.sharpness)).collect();
        let patterns = rows(&found?);
        let labels: Vec<usize> =
            all.iter().map(|clip| activities.iter().position(|a| *a == clip.activity).unwrap_or(0)).collect();
        let classifier = Classifier::train(settings.classifier, patterns.view(), &labels, activities.len());
        Ok(Self {
            far: unknown_beyond(&patterns),
            settings: settings.clone(),
            activities,
            views,
            space,
            classifier,
            patterns,
        })
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
        let pattern = pattern(&self.space, views, self.settings.sharpness)?;
        let shares = self.classifier.shares(pattern.view());
        let (best, confidence) = self.classifier.best(pattern.view());
        let strangeness = nearest(&self.patterns, &pattern, None) / self.far.max(1e-9);
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
                let repeats = if self.settings.space.mode == super::frames::Mode::Ordered { 3 } else { 2 };
                book.centres.ncols() > repeats * dimensions
            }
        }
    }

    /// The model as a file's bytes.
    ///
    /// # Errors
    /// [`ModelError::Body`] if it cannot be encoded.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelError> {
        let body = Body {
            settings: self.settings.clone(),
            activities: self.activities.clone(),
            views: self.views,
            map: match &self.space.map {
                Map::Rbf(rbf) => SavedMap::Rbf {
                    centres: rbf.centres.clone(),
                    weights: rbf.weights.clone(),
                    gamma: rbf.gamma,
                    ridge: rbf.ridge,
                    condition: rbf.condition,
                },
                Map::Pca(pca) => SavedMap::Pca {
                    mean: pca.mean.clone(),
                    directions: pca.directions.clone(),
                    variances: pca.variances.clone(),
                },
            },
            spread: self.space.spread,
            neighbours: self.space.neighbours,
            pattern: match &self.space.pattern {
                Pattern::Thesis(grid) => SavedPattern::Thesis(grid.clone()),
                Pattern::Codebook(book) => SavedPattern::Codebook(book.clone()),
            },
            classifier: self.classifier.clone(),
            far: self.far,
            patterns: self.patterns.clone(),
        };
        let body = postcard::to_stdvec(&body).map_err(|error| ModelError::Body(error.to_string()))?;
        let mut bytes = Vec::with_capacity(HEADER + body.len());
        bytes.extend(MAGIC);
        bytes.extend(FORMAT_VERSION.to_le_bytes());
        bytes.extend(DESCRIPTOR_VERSION.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(checksum(&body).to_le_bytes());
        bytes.extend(body);
        Ok(bytes)
    }

    /// A model from a file's bytes.
    ///
    /// # Errors
    /// Anything that is not a whole, undamaged model of this version and this descriptor.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ModelError> {
        let header = bytes.get(..HEADER).ok_or(ModelError::NotAModel("shorter than its header"))?;
        if &header[..8] != MAGIC {
            return Err(ModelError::NotAModel("it does not start with `farnearA`"));
        }
        let word = |at: usize| u32::from_le_bytes(header[at..at + 4].try_into().unwrap_or_default());
        for (what, at, expected) in [("format", 8, FORMAT_VERSION), ("descriptor", 12, DESCRIPTOR_VERSION)] {
            if word(at) != expected {
                return Err(ModelError::Version { what, found: word(at), expected });
            }
        }
        let body = &bytes[HEADER..];
        if body.len() as u64 != u64::from_le_bytes(header[16..24].try_into().unwrap_or_default()) {
            return Err(ModelError::NotAModel("its length is not what its header says (cut short?)"));
        }
        if checksum(body) != word(24) {
            return Err(ModelError::Checksum { found: checksum(body), expected: word(24) });
        }
        let body: Body = postcard::from_bytes(body).map_err(|error| ModelError::Body(error.to_string()))?;
        let map = match body.map {
            SavedMap::Rbf { centres, weights, gamma, ridge, condition } => {
                Map::Rbf(Rbf::assemble(centres, weights, gamma, ridge, condition))
            }
            SavedMap::Pca { mean, directions, variances } => Map::Pca(Pca { mean, directions, variances }),
        };
        let pattern = match body.pattern {
            SavedPattern::Thesis(grid) => Pattern::Thesis(grid),
            SavedPattern::Codebook(book) => Pattern::Codebook(book),
        };
        let space = Space {
            settings: body.settings.space.clone(),
            map,
            spread: body.spread,
            pattern,
            neighbours: body.neighbours,
        };
        Ok(Self {
            settings: body.settings,
            activities: body.activities,
            views: body.views,
            space,
            classifier: body.classifier,
            far: body.far,
            patterns: body.patterns,
        })
    }
}

/// CRC-32 as in zip files.
fn checksum(body: &[u8]) -> u32 {
    crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(body)
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

/// Squared distance to the nearest pattern but `except`.
fn nearest(patterns: &Array2<f32>, query: &Array1<f32>, except: Option<usize>) -> f32 {
    let others = patterns.rows().into_iter().enumerate().filter(|(i, _)| Some(*i) != except);
    others
        .map(|(_, row)| row.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum())
        .fold(f32::INFINITY, f32::min)
}

/// Beyond this squared distance to every training pattern nothing is known: half as far again as the strangest of them lies
/// from its nearest other.
fn unknown_beyond(patterns: &Array2<f32>) -> f32 {
    let apart = (0..patterns.nrows()).map(|i| nearest(patterns, &patterns.row(i).to_owned(), Some(i)));
    1.5 * apart.filter(|d| d.is_finite()).fold(0.0_f32, f32::max)
}
