//! Models as files: bytes with a version and a checksum.
//!
//! The 8 bytes `farnearA`, format version (u32), descriptor version (u32), length of the body (u64), CRC-32 of the body (u32), all
//! little-endian, then the body (postcard), in version 3 followed by the classes of its patterns. Anything that does not fit is refused by name, never guessed; a body that decodes is
//! also checked part against part, so that a crafted file cannot make recognition panic.

use super::classifier::Classifier;
use super::clip::BOX_NUMBERS;
use super::codebook::Codebook;
use super::frames::Mode;
use super::model::{ModelError, Recogniser, RecogniserSettings};
use super::network::Network;
use super::network::features::Features;
use super::occupancy::OccupancyGrid;
use super::second_opinion::SecondOpinion;
use super::space::{Map, Pattern, Space};
use super::unknown::Limits;
use crate::embedding::descriptor::{ANGLES, CELLS, DESCRIPTOR_VERSION};
use crate::embedding::pca::Pca;
use crate::embedding::rbf::Rbf;
use ndarray::{Array1, Array2};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Version of the file's format.
pub const FORMAT_VERSION: u32 = 4;
/// The version before, without a second opinion; models that have none are written so still.
const SINGLE_VERSION: u32 = 3;
/// The version before that, which is read too: it has no labels.
const UNLABELLED_VERSION: u32 = 2;
const MAGIC: &[u8; 8] = b"farnearA";
const HEADER: usize = 28;

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
    limits: Limits,
    patterns: Array2<f32>,
    typical_frames: u64,
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
    Network(Box<Network>),
    Features(Box<Features>),
}

impl Recogniser {
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
                Pattern::Network(network) => SavedPattern::Network(network.clone()),
                Pattern::Features(features) => SavedPattern::Features(features.clone()),
            },
            classifier: self.classifier.clone(),
            limits: self.limits.clone(),
            patterns: self.patterns.clone(),
            typical_frames: self.typical_frames as u64,
        };
        let encoded = match &self.second {
            None => postcard::to_stdvec(&(body, &self.labels)),
            Some(second) => {
                let other = second.recogniser.to_bytes()?;
                postcard::to_stdvec(&(body, &self.labels, &other, &second.profiles, &second.limits))
            }
        };
        let version = if self.second.is_some() { FORMAT_VERSION } else { SINGLE_VERSION };
        let body = encoded.map_err(|error| ModelError::Body(error.to_string()))?;
        let mut bytes = Vec::with_capacity(HEADER + body.len());
        bytes.extend(MAGIC);
        bytes.extend(version.to_le_bytes());
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
        let version = word(8);
        for (what, at, expected) in [("format", 8, FORMAT_VERSION), ("descriptor", 12, DESCRIPTOR_VERSION)] {
            if word(at) != expected && !(at == 8 && [SINGLE_VERSION, UNLABELLED_VERSION].contains(&version)) {
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
        let wrong = |error: postcard::Error| ModelError::Body(error.to_string());
        let (body, rest) = postcard::take_from_bytes::<Body>(body).map_err(wrong)?;
        let (labels, second) = match version {
            UNLABELLED_VERSION => (Vec::new(), None),
            SINGLE_VERSION => (postcard::from_bytes(rest).map_err(wrong)?, None),
            _ => {
                let (labels, other, profiles, limits): (_, Vec<u8>, _, _) =
                    postcard::from_bytes(rest).map_err(wrong)?;
                // Who says something of another has nobody behind it: a file may nest without end.
                if other.get(8..12) == Some(&FORMAT_VERSION.to_le_bytes()) {
                    return Err(ModelError::Parts("the second opinion"));
                }
                let other = Self::from_bytes(&other).map_err(|error| ModelError::Second(Box::new(error)))?;
                (labels, Some(SecondOpinion { recogniser: Arc::new(other), profiles, limits }))
            }
        };
        let map = match body.map {
            SavedMap::Rbf { centres, weights, gamma, ridge, condition } => {
                Map::Rbf(Rbf::assemble(centres, weights, gamma, ridge, condition))
            }
            SavedMap::Pca { mean, directions, variances } => Map::Pca(Pca { mean, directions, variances }),
        };
        let pattern = match body.pattern {
            SavedPattern::Thesis(grid) => Pattern::Thesis(grid),
            SavedPattern::Codebook(book) => Pattern::Codebook(book),
            SavedPattern::Network(network) => Pattern::Network(network),
            SavedPattern::Features(features) => Pattern::Features(features),
        };
        let space = Space {
            settings: body.settings.space.clone(),
            map,
            spread: body.spread,
            pattern,
            neighbours: body.neighbours,
            brought: None,
        };
        let recogniser = Self {
            settings: body.settings,
            activities: body.activities,
            views: body.views,
            space,
            classifier: body.classifier,
            limits: body.limits,
            patterns: body.patterns,
            labels,
            second,
            typical_frames: body.typical_frames as usize,
        };
        recogniser.checked()
    }
}

/// CRC-32 as in zip files.
fn checksum(body: &[u8]) -> u32 {
    crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(body)
}

impl Recogniser {
    /// Checks that all parts have the sizes that recognition relies on.
    fn checked(self) -> Result<Self, ModelError> {
        let fits =
            |holds: bool, what: &'static str| if holds { Ok(()) } else { Err(ModelError::Parts(what)) };
        fits(self.activities.len() >= 2 && self.views >= 1, "activities or views are missing")?;
        let dimensions = match &self.space.map {
            Map::Rbf(rbf) => {
                let sizes = rbf.centres.ncols() == ANGLES && rbf.weights.nrows() == rbf.centres.nrows();
                fits(sizes && rbf.weights.ncols() > 0, "centres and weights of the RBF map")?;
                rbf.dimensions()
            }
            Map::Pca(pca) => {
                let width = pca.mean.len();
                let sizes = [ANGLES, ANGLES + CELLS].contains(&width) && pca.directions.ncols() == width;
                fits(sizes && pca.directions.nrows() > 0, "mean and directions of the principal components")?;
                pca.directions.nrows()
            }
        };
        fits(self.space.spread > 0.0, "the gallery's spread")?;
        let ordered = self.settings.space.mode == Mode::Ordered;
        let width = |boxes: usize| 2 * dimensions + boxes + if ordered { dimensions + boxes } else { 0 };
        let of_frame = |found: usize| found == width(0) || found == width(BOX_NUMBERS);
        let of_view = match &self.space.pattern {
            Pattern::Thesis(grid) => {
                let sizes = [grid.low.len(), grid.range.len()] == [grid.bins.len(); 2];
                fits(
                    sizes && grid.bins.len() <= dimensions && !grid.bins.contains(&0),
                    "the grid's dimensions",
                )?;
                grid.bins.iter().try_fold(1_usize, |product, &bins| product.checked_mul(bins))
            }
            Pattern::Network(network) => {
                let found = network.mean.len();
                fits(of_frame(found) && network.fits(found), "the network's layers")?;
                Some(network.width())
            }
            Pattern::Features(features) => {
                let found = features.network.mean.len();
                fits(of_frame(found) && features.fits(found), "the network's layers and its features")?;
                Some(features.network.width())
            }
            Pattern::Codebook(book) => {
                let found = book.centres.ncols();
                fits(of_frame(found), "the codebook's width")?;
                if let Some(residual) = &book.residual {
                    let same = residual.centres.ncols() == found && residual.residual.is_none();
                    fits(same, "the width of the residuals' centres")?;
                }
                book.pattern_width(self.settings.space.mode)
            }
        };
        let width = of_view.and_then(|width| width.checked_mul(self.views)).unwrap_or(usize::MAX);
        fits(self.patterns.ncols() == width, "the training patterns' width")?;
        let labelled = self.labels.len() == self.patterns.nrows()
            && self.labels.iter().all(|label| *label < self.activities.len());
        fits(self.labels.is_empty() || labelled, "the training patterns' activities")?;
        fits(self.limits.distances.len() == self.activities.len(), "the limits of what is known")?;
        fits(self.classifier.fits(width, self.activities.len()), "the classifier")?;
        let second = self.second.as_ref();
        let judges = second.is_none_or(|second| second.fits(self.activities.len(), self.uses_boxes()));
        fits(judges, "the second opinion")?;
        Ok(self)
    }
}
