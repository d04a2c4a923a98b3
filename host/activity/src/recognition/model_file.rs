//! Models as files: bytes with a version and a checksum.
//!
//! The 8 bytes `farnearA`, format version (u32), descriptor version (u32), length of the body (u64), CRC-32 of the body (u32), all
//! little-endian, then the body (postcard), from version 3 on followed by the classes of its patterns, in version 4 by a second opinion, in
//! version 5, which networks of several members have, by a second opinion or none. Anything that does not fit is refused by name, never guessed; a
//! body that decodes is also checked part against part, so that a crafted file cannot make recognition panic.

use super::classifier::Classifier;
use super::clip::BOX_NUMBERS;
use super::codebook::Codebook;
use super::frames::Mode;
use super::model::{ModelError, Recogniser, RecogniserSettings};
use super::network::features::Features;
use super::network::{Layers, Network};
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
pub const FORMAT_VERSION: u32 = 5;
/// The version before, without networks of several members; models that have a second opinion and no such network are written so still.
const SECOND_VERSION: u32 = 4;
/// The version before that, without a second opinion; models that have none are written so still.
const SINGLE_VERSION: u32 = 3;
/// The version before that, which is read too: it has no labels.
const UNLABELLED_VERSION: u32 = 2;
const READ: [u32; 4] = [UNLABELLED_VERSION, SINGLE_VERSION, SECOND_VERSION, FORMAT_VERSION];
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
    Network(Box<OneMember>),
    Features(Box<OneMember>, Array1<f32>, Array1<f32>),
    Members(Box<Network>),
    FeaturesOfMembers(Box<Features>),
}

/// A network of one member, as files had it when there were no others.
#[derive(Serialize, Deserialize)]
struct OneMember {
    mean: Array1<f32>,
    spread: Array1<f32>,
    layers: Layers,
}

impl OneMember {
    /// The network, if it has but one member.
    fn of(network: &Network) -> Option<Box<Self>> {
        let [layers] = network.members.as_slice() else { return None };
        Some(Box::new(Self {
            mean: network.mean.clone(),
            spread: network.spread.clone(),
            layers: layers.clone(),
        }))
    }
}

impl From<OneMember> for Network {
    fn from(OneMember { mean, spread, layers }: OneMember) -> Self {
        Self { mean, spread, members: vec![layers] }
    }
}

impl SavedPattern {
    fn of(pattern: &Pattern) -> Self {
        match pattern {
            Pattern::Thesis(grid) => Self::Thesis(grid.clone()),
            Pattern::Codebook(book) => Self::Codebook(book.clone()),
            Pattern::Network(network) => {
                OneMember::of(network).map_or_else(|| Self::Members(network.clone()), Self::Network)
            }
            Pattern::Features(features) => match OneMember::of(&features.network) {
                Some(one) => Self::Features(one, features.mean.clone(), features.scale.clone()),
                None => Self::FeaturesOfMembers(features.clone()),
            },
        }
    }

    fn read(self) -> Pattern {
        match self {
            Self::Thesis(grid) => Pattern::Thesis(grid),
            Self::Codebook(book) => Pattern::Codebook(book),
            Self::Network(one) => Pattern::Network(Box::new((*one).into())),
            Self::Features(one, mean, scale) => {
                Pattern::Features(Box::new(Features { network: (*one).into(), mean, scale }))
            }
            Self::Members(network) => Pattern::Network(network),
            Self::FeaturesOfMembers(features) => Pattern::Features(features),
        }
    }

    /// Whether programs of before know it.
    fn is_old(&self) -> bool {
        !matches!(self, Self::Members(_) | Self::FeaturesOfMembers(_))
    }
}

/// A second opinion: the other recogniser's file, its profiles and limits.
type SavedSecond = (Vec<u8>, Array2<f32>, Limits);

impl Recogniser {
    /// The model as a file's bytes, in the oldest format that has all it holds.
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
            pattern: SavedPattern::of(&self.space.pattern),
            classifier: self.classifier.clone(),
            limits: self.limits.clone(),
            patterns: self.patterns.clone(),
            typical_frames: self.typical_frames as u64,
        };
        let second: Option<SavedSecond> = match &self.second {
            None => None,
            Some(second) => {
                Some((second.recogniser.to_bytes()?, second.profiles.clone(), second.limits.clone()))
            }
        };
        let version = match &second {
            _ if !body.pattern.is_old() => FORMAT_VERSION,
            Some(_) => SECOND_VERSION,
            None => SINGLE_VERSION,
        };
        let encoded = match second {
            second if version == FORMAT_VERSION => postcard::to_stdvec(&(body, &self.labels, second)),
            None => postcard::to_stdvec(&(body, &self.labels)),
            Some((other, profiles, limits)) => {
                postcard::to_stdvec(&(body, &self.labels, other, profiles, limits))
            }
        };
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
        Self::read(bytes, true)
    }

    /// A model; who says something of another has nobody behind it, or a file might nest without end.
    fn read(bytes: &[u8], may_have_second: bool) -> Result<Self, ModelError> {
        let header = bytes.get(..HEADER).ok_or(ModelError::NotAModel("shorter than its header"))?;
        if &header[..8] != MAGIC {
            return Err(ModelError::NotAModel("it does not start with `farnearA`"));
        }
        let word = |at: usize| u32::from_le_bytes(header[at..at + 4].try_into().unwrap_or_default());
        let version = word(8);
        if !READ.contains(&version) {
            return Err(ModelError::Version { what: "format", found: version, expected: FORMAT_VERSION });
        }
        if word(12) != DESCRIPTOR_VERSION {
            let (found, expected) = (word(12), DESCRIPTOR_VERSION);
            return Err(ModelError::Version { what: "descriptor", found, expected });
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
        let (labels, second): (Vec<usize>, Option<SavedSecond>) = match version {
            UNLABELLED_VERSION => (Vec::new(), None),
            SINGLE_VERSION => (postcard::from_bytes(rest).map_err(wrong)?, None),
            SECOND_VERSION => {
                let (labels, other, profiles, limits) = postcard::from_bytes(rest).map_err(wrong)?;
                (labels, Some((other, profiles, limits)))
            }
            _ => postcard::from_bytes(rest).map_err(wrong)?,
        };
        let second = match second {
            None => None,
            Some(_) if !may_have_second => return Err(ModelError::Parts("the second opinion")),
            Some((other, profiles, limits)) => {
                let other = Self::read(&other, false).map_err(|error| ModelError::Second(Box::new(error)))?;
                Some(SecondOpinion { recogniser: Arc::new(other), profiles, limits })
            }
        };
        let map = match body.map {
            SavedMap::Rbf { centres, weights, gamma, ridge, condition } => {
                Map::Rbf(Rbf::assemble(centres, weights, gamma, ridge, condition))
            }
            SavedMap::Pca { mean, directions, variances } => Map::Pca(Pca { mean, directions, variances }),
        };
        let pattern = body.pattern.read();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embedding::descriptor::Scaling;
    use crate::recognition::network::training::NetworkSettings;
    use crate::recognition::space::SpaceSettings;
    use crate::recognition::watch::Unwatched;
    use crate::synthetic::everyday;

    /// A small model of two activities.
    fn model(members: usize) -> Recogniser {
        let clips = |first: usize, people: usize| {
            let mut clips = everyday::clips(first, people, Scaling::default());
            clips.retain(|clip| ["walk", "lie down"].contains(&clip.activity.as_str()));
            clips
        };
        let space = SpaceSettings { dimensions: 4, gallery: 100, ..SpaceSettings::default() };
        let network = NetworkSettings { widths: [4, 5, 6], passes: 1, members, ..NetworkSettings::default() };
        let (people, others) = (clips(0, 3), clips(9, 2));
        Recogniser::train_network(&people, &others, &space, &network, Scaling::default(), &Unwatched)
            .expect("trained")
    }

    #[test]
    fn one_member_is_written_as_before_and_several_in_a_format_of_their_own() {
        let version = |model: &Recogniser| {
            let bytes = model.to_bytes().expect("encoded");
            assert_eq!(&Recogniser::from_bytes(&bytes).expect("decoded"), model);
            u32::from(bytes[8])
        };
        let (one, two) = (model(1), model(2));
        assert_eq!([version(&one), version(&two)], [SINGLE_VERSION, FORMAT_VERSION]);
        // As the file's format 3 has always had it: mean, spread, three layers, with no count before them.
        let Pattern::Network(network) = &one.space.pattern else { panic!("a network") };
        let saved = OneMember::of(network).expect("one member");
        let [first, second, third] = &network.members[0];
        assert_eq!(
            postcard::to_stdvec(&saved),
            postcard::to_stdvec(&(&network.mean, &network.spread, first, second, third))
        );
        let second = |of: &Recogniser, by: &Recogniser| {
            let limits = Limits::none(of.activities.len());
            let profiles = Array2::zeros((of.activities.len(), by.activities.len()));
            let second = SecondOpinion { recogniser: Arc::new(by.clone()), profiles, limits };
            Recogniser { second: Some(second), ..of.clone() }
        };
        assert_eq!(version(&second(&one, &two)), SECOND_VERSION);
        assert_eq!(version(&second(&two, &two)), FORMAT_VERSION);
        let nested = second(&two, &second(&two, &two)).to_bytes().expect("encoded");
        assert!(Recogniser::from_bytes(&nested).is_err(), "nested without end");
    }
}
