//! Model files: 8 bytes `farnearA`, format version (u32), descriptor version (u32), body length (u64), CRC-32 of the
//! body (u32), little-endian; then the body (postcard), pattern classes, an optional auxiliary model, and clip lengths.
//! Decoded parts are checked against each other: a crafted file cannot panic.

use super::auxiliary_model::AuxiliaryModel;
use super::classifier::Classifier;
use super::clip::BOX_NUMBERS;
use super::frames::Mode;
use super::lengths::Lengths;
use super::model::{ModelError, Recogniser, RecogniserSettings};
use super::space::{Map, Pattern, Space};
use super::unknown::Limits;
use crate::embedding::{
    descriptor::{ANGLES, CELLS, DESCRIPTOR_VERSION},
    pca::Pca,
    rbf::Rbf,
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Version of the file format.
pub const FORMAT_VERSION: u32 = 7;
const MAGIC: &[u8; 8] = b"farnearA";
const HEADER: usize = 28;

#[derive(Serialize, Deserialize)]
struct Body {
    settings: RecogniserSettings,
    activities: Vec<String>,
    views: usize,
    map: SavedMap,
    spread: f32,
    neighbours: usize,
    pattern: Pattern,
    classifier: Classifier,
    limits: Limits,
    patterns: Array2<f32>,
    typical_frames: u64,
}

#[derive(Serialize, Deserialize)]
enum SavedMap {
    Rbf { centres: Array2<f32>, weights: Array2<f32>, gamma: f32, ridge: f64, condition: f64 },
    Pca(Pca),
}

/// Whether a file that begins with `bytes` is a model, of any version.
#[must_use]
pub fn is_model(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

type SavedAuxiliary = (Vec<u8>, Array2<f32>, Limits);

impl Recogniser {
    /// Encodes the model; fails with [`ModelError::Body`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, ModelError> {
        let saved = |second: &AuxiliaryModel| -> Result<SavedAuxiliary, ModelError> {
            Ok((second.recogniser.to_bytes()?, second.profiles.clone(), second.limits.clone()))
        };
        let second = self.second.as_ref().map(saved).transpose()?;
        let body = postcard::to_stdvec(&(self.body(), &self.labels, second, &self.lengths))
            .map_err(|error| ModelError::Body(error.to_string()))?;
        let mut bytes = Vec::with_capacity(HEADER + body.len());
        bytes.extend(MAGIC);
        bytes.extend(FORMAT_VERSION.to_le_bytes());
        bytes.extend(DESCRIPTOR_VERSION.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(checksum(&body).to_le_bytes());
        bytes.extend(body);
        Ok(bytes)
    }

    fn body(&self) -> Body {
        Body {
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
                Map::Pca(pca) => SavedMap::Pca(pca.clone()),
            },
            spread: self.space.spread,
            neighbours: self.space.neighbours,
            pattern: self.space.pattern.clone(),
            classifier: self.classifier.clone(),
            limits: self.limits.clone(),
            patterns: self.patterns.clone(),
            typical_frames: self.typical_frames as u64,
        }
    }

    /// Decodes a whole, undamaged model of this format and descriptor version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ModelError> {
        Self::read(bytes, true)
    }

    /// An auxiliary model has no auxiliary model, which bounds the nesting.
    fn read(bytes: &[u8], may_have_second: bool) -> Result<Self, ModelError> {
        let header = bytes.get(..HEADER).ok_or(ModelError::NotAModel("shorter than its header"))?;
        if &header[..8] != MAGIC {
            return Err(ModelError::NotAModel("it does not start with `farnearA`"));
        }
        let word = |at: usize| u32::from_le_bytes(header[at..at + 4].try_into().unwrap_or_default());
        if word(8) != FORMAT_VERSION {
            let (found, expected) = (word(8), FORMAT_VERSION);
            return Err(ModelError::Version { what: "format", found, expected });
        }
        if word(12) != DESCRIPTOR_VERSION {
            let (found, expected) = (word(12), DESCRIPTOR_VERSION);
            return Err(ModelError::Version { what: "descriptor", found, expected });
        }
        let body = &bytes[HEADER..];
        if body.len() as u64 != u64::from_le_bytes(header[16..24].try_into().unwrap_or_default()) {
            return Err(ModelError::NotAModel("its length differs from its header (cut short?)"));
        }
        if checksum(body) != word(24) {
            return Err(ModelError::Checksum { found: checksum(body), expected: word(24) });
        }
        let wrong = |error: postcard::Error| ModelError::Body(error.to_string());
        let (body, labels, second, lengths): (Body, Vec<usize>, Option<SavedAuxiliary>, Vec<Lengths>) =
            postcard::from_bytes(body).map_err(wrong)?;
        let second = match second {
            None => None,
            Some(_) if !may_have_second => return Err(ModelError::Parts("the auxiliary model")),
            Some((other, profiles, limits)) => {
                let other = Self::read(&other, false).map_err(|error| ModelError::Second(Box::new(error)))?;
                Some(AuxiliaryModel { recogniser: Arc::new(other), profiles, limits })
            }
        };
        let map = match body.map {
            SavedMap::Rbf { centres, weights, gamma, ridge, condition } => {
                Map::Rbf(Rbf::assemble(centres, weights, gamma, ridge, condition))
            }
            SavedMap::Pca(pca) => Map::Pca(pca),
        };
        let space = Space {
            settings: body.settings.space.clone(),
            map,
            spread: body.spread,
            pattern: body.pattern,
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
            among: Vec::new(),
            typical_frames: body.typical_frames as usize,
            lengths,
        };
        recogniser.checked()
    }
}

fn checksum(body: &[u8]) -> u32 {
    crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(body)
}

impl Recogniser {
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
        fits(self.limits.distances.len() == self.activities.len(), "the limits for unknown activities")?;
        fits(self.classifier.fits(width, self.activities.len()), "the classifier")?;
        let measured =
            self.lengths.len() == self.activities.len() && self.lengths.iter().all(Lengths::is_sound);
        fits(measured, "how long clips last")?;
        let second = self.second.as_ref();
        let judges = second.is_none_or(|second| second.fits(self.activities.len(), self.uses_boxes()));
        fits(judges, "the auxiliary model")?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embedding::descriptor::Scaling;
    use crate::network::training::NetworkSettings;
    use crate::space::SpaceSettings;
    use crate::synthetic::everyday;
    use crate::watch::Unwatched;

    fn model(members: usize) -> Recogniser {
        let clips = |first: usize, people: usize| {
            everyday::clips_of(&["walk", "lie down"], first, people, Scaling::default())
        };
        let space = SpaceSettings { dimensions: 4, gallery: 100, ..SpaceSettings::default() };
        let network = NetworkSettings { widths: [4, 5, 6], passes: 1, members, ..NetworkSettings::default() };
        let (people, others) = (clips(0, 3), clips(9, 2));
        Recogniser::train_network(&people, &others, &space, &network, Scaling::default(), &Unwatched)
            .expect("trained")
    }

    fn with_second(of: &Recogniser, by: &Recogniser) -> Recogniser {
        let limits = Limits::none(of.activities.len());
        let profiles = Array2::zeros((of.activities.len(), by.activities.len()));
        let second = AuxiliaryModel { recogniser: Arc::new(by.clone()), profiles, limits };
        Recogniser { second: Some(second), ..of.clone() }
    }

    #[test]
    fn files_are_read_as_written() {
        let (one, two) = (model(1), model(2));
        for model in [&one, &two, &with_second(&two, &one)] {
            let bytes = model.to_bytes().expect("encoded");
            assert_eq!(&Recogniser::from_bytes(&bytes).expect("decoded"), model);
        }
        let nested = with_second(&two, &with_second(&two, &two)).to_bytes().expect("encoded");
        assert!(Recogniser::from_bytes(&nested).is_err(), "nested without end");
        let short = Recogniser { lengths: two.lengths[..1].to_vec(), ..two.clone() };
        let error =
            Recogniser::from_bytes(&short.to_bytes().expect("encoded")).expect_err("a length is missing");
        assert!(error.to_string().contains("how long clips last"), "{error}");
    }
}
