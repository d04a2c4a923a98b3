//! Embedding of frames and patterns of clips.

use super::alignment::Brought;
use super::clip::{Clip, Track};
use super::codebook::{Codebook, stacked};
use super::frames::{self, Mode, Weights};
use super::network::Network;
use super::network::features::{Features, values};
use super::occupancy::OccupancyGrid;
use crate::embedding::{
    EmbeddingError,
    descriptor::{ANGLES, CELLS},
    isomap::isomap,
    landmark::landmark_isomap,
    pca::Pca,
    rbf::Rbf,
};
use ndarray::{Array1, Array2, ArrayView2, s};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Layout of the gallery.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Isomap with at least this many neighbours, doubled until the graph is connected.
    Isomap(usize),
    /// Principal components (PCA), without neighbours.
    Pca,
}

/// Type of a clip's pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PatternKind {
    /// Visited cells of a grid as in Li 2014: members per dimension.
    Thesis(Vec<usize>),
    /// Square-rooted mean soft assignments to a codebook of this size.
    Codebook(usize),
    /// Output of a network ([`Recogniser::train_network`](super::model::Recogniser)); its principal
    /// components see coarse silhouettes as well as centroid distances.
    Network,
}

/// Settings before patterns exist. By default twenty principal components, which need no connected neighbour graph;
/// [`Self::thesis`] uses Isomap. Report accuracies of settings chosen on other subjects
/// ([`super::experiment::Experiment::searched`]), not for these defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpaceSettings {
    pub layout: Layout,
    pub dimensions: usize,
    /// Largest number of gallery silhouettes.
    pub gallery: usize,
    pub gamma: f32,
    pub ridge: f64,
    pub pattern: PatternKind,
    /// Centres of residuals in codebook patterns; 0 for none, no effect on the thesis' grid.
    pub residuals: usize,
    pub mode: Mode,
    pub weights: Weights,
    pub seed: u64,
}

impl Default for SpaceSettings {
    fn default() -> Self {
        Self {
            layout: Layout::Pca,
            dimensions: 20,
            gallery: 1500,
            gamma: 0.1,
            ridge: 1e-3,
            pattern: PatternKind::Codebook(200),
            residuals: 32,
            mode: Mode::OrderFree,
            weights: Weights::default(),
            seed: 1,
        }
    }
}

impl SpaceSettings {
    /// For few short clips.
    #[cfg(test)]
    pub(crate) fn small() -> Self {
        Self { dimensions: 4, pattern: PatternKind::Codebook(8), residuals: 0, ..Self::default() }
    }

    /// Settings of the thesis: three dimensions, 15 x 9 x 9 cells.
    pub fn thesis() -> Self {
        Self {
            layout: Layout::Isomap(12),
            dimensions: 3,
            pattern: PatternKind::Thesis(vec![15, 9, 9]),
            ..Self::default()
        }
    }
}

/// Embedding of new silhouettes.
#[derive(Clone, Debug, PartialEq)]
pub enum Map {
    Rbf(Rbf),
    Pca(Pca),
}

/// Patterns of embedded clips. Model files number them in this order: append new ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Pattern {
    Thesis(OccupancyGrid),
    Codebook(Codebook),
    Network(Box<Network>),
    /// Network features for another classifier.
    Features(Box<Features>),
}

/// The learned space of frames and patterns.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    pub settings: SpaceSettings,
    pub map: Map,
    /// Gallery spread along the first dimension, the divisor of points.
    pub spread: f32,
    pub pattern: Pattern,
    /// Neighbours of the connected Isomap graph, 0 for PCA.
    pub neighbours: usize,
    /// Alignment to the training clips, for clips from elsewhere; not saved.
    pub brought: Option<Brought>,
}

impl Space {
    /// Learns from all views of the clips. Fails for too few silhouettes or an impossible layout.
    pub fn train(clips: &[&Clip], settings: &SpaceSettings) -> Result<Self, EmbeddingError> {
        Galleries::default().space(clips, settings).map(|(space, _)| space)
    }

    /// Embedded frames of a track: frames x D, over the gallery's spread.
    pub fn points(&self, track: &Track) -> Result<Array2<f32>, EmbeddingError> {
        self.map.points(track, self.spread)
    }

    /// Frame vectors of a track, the codebook's input. Fails for another descriptor length.
    pub fn vectors(&self, track: &Track) -> Result<Array2<f32>, EmbeddingError> {
        let points = self.points(track)?;
        Ok(self.vectors_of(points.view(), track.boxes.as_ref().map(|boxes| boxes.view())))
    }

    /// Frame vectors from embedded frames and boxes.
    pub fn vectors_of(&self, points: ArrayView2<f32>, boxes: Option<ArrayView2<f32>>) -> Array2<f32> {
        let vectors = match self.settings.pattern {
            PatternKind::Thesis(_) => points.to_owned(),
            PatternKind::Codebook(_) | PatternKind::Network => {
                frames::vectors(points, boxes, self.settings.mode, self.settings.weights)
            }
        };
        match &self.brought {
            Some(brought) => brought.apply(&vectors),
            None => vectors,
        }
    }

    /// The space with its network's output, normalised over `clips`, as features; other spaces are unchanged.
    pub fn with_features(&self, clips: &[&Clip]) -> Result<Self, EmbeddingError> {
        let network = match &self.pattern {
            Pattern::Network(network) => network,
            Pattern::Features(features) => &features.network,
            Pattern::Thesis(_) | Pattern::Codebook(_) => return Ok(self.clone()),
        };
        let vectors: Result<Vec<Array2<f32>>, EmbeddingError> =
            clips.par_iter().flat_map_iter(|clip| &clip.views).map(|view| self.vectors(view)).collect();
        let features = Features::fitted(network.clone(), values(network, &vectors?).view());
        Ok(Self { pattern: Pattern::Features(Box::new(features)), ..self.clone() })
    }

    pub fn pattern_of(&self, vectors: ArrayView2<f32>, sharpness: f32) -> Array1<f32> {
        match &self.pattern {
            Pattern::Thesis(grid) => grid.pattern(vectors),
            Pattern::Codebook(book) => book.pattern(vectors, self.settings.mode, sharpness),
            Pattern::Network(network) => network.pattern(vectors),
            Pattern::Features(features) => features.pattern(vectors),
        }
    }
}

fn evenly(tracks: &[&Track], count: usize, width: usize) -> Array2<f32> {
    let frames: Vec<(&Track, usize)> =
        tracks.iter().flat_map(|track| (0..track.frames()).map(|frame| (*track, frame))).collect();
    let n = frames.len();
    let kept = n.min(count);
    let mut rows = Array2::zeros((kept, width));
    for (i, row) in rows.rows_mut().into_iter().enumerate() {
        let (track, frame) = frames[(2 * i + 1) * n / (2 * kept)];
        track.seen(frame, row);
    }
    rows
}

/// Larger galleries use landmarks.
const LARGE: usize = 4000;

#[derive(Debug)]
struct Gallery {
    key: (Layout, usize, usize, usize),
    samples: Array2<f32>,
    coordinates: Array2<f32>,
    pca: Option<Pca>,
    neighbours: usize,
}

type FrameVectors = Vec<Vec<Array2<f32>>>;

/// Cached galleries of one set of clips, and their embedded frames.
#[derive(Debug, Default)]
pub struct Galleries {
    galleries: Vec<Gallery>,
    embedded: Vec<Embedded>,
}

impl Galleries {
    /// The space of `settings` for all views of the clips, and their frame vectors `[clip][view]`. All calls
    /// must pass the same clips. Fails for too few silhouettes or a gallery that cannot be laid out.
    pub fn space(
        &mut self,
        clips: &[&Clip],
        settings: &SpaceSettings,
    ) -> Result<(Space, FrameVectors), EmbeddingError> {
        let at = self.embedded(clips, settings)?;
        let embedded = &self.embedded[at];
        let gallery = &self.galleries[embedded.gallery];
        let mut space = Space {
            settings: settings.clone(),
            map: embedded.map.clone(),
            spread: embedded.spread,
            pattern: Pattern::Thesis(OccupancyGrid { low: Vec::new(), range: Vec::new(), bins: Vec::new() }),
            neighbours: gallery.neighbours,
            brought: None,
        };
        let vectors: FrameVectors = clips
            .par_iter()
            .zip(&embedded.points)
            .map(|(clip, points)| {
                let boxes = clip.views.iter().map(|track| track.boxes.as_ref().map(|boxes| boxes.view()));
                points
                    .iter()
                    .zip(boxes)
                    .map(|(points, boxes)| space.vectors_of(points.view(), boxes))
                    .collect()
            })
            .collect();
        match &settings.pattern {
            // Learned later with labels.
            PatternKind::Network => {}
            PatternKind::Thesis(bins) => {
                let coordinates = &gallery.coordinates / embedded.spread;
                space.pattern = Pattern::Thesis(OccupancyGrid::new(coordinates.view(), bins));
            }
            PatternKind::Codebook(size) => {
                let frames = stacked(vectors.iter().flatten().map(|v| v.view()));
                let book = Codebook::train(frames.view(), *size, settings.seed);
                let book = book.with_residuals(frames.view(), settings.residuals, settings.seed);
                space.pattern = Pattern::Codebook(book);
            }
        }
        Ok((space, vectors))
    }

    /// Index of the clips embedded by these settings' map, independent of weights and patterns.
    fn embedded(&mut self, clips: &[&Clip], settings: &SpaceSettings) -> Result<usize, EmbeddingError> {
        let gallery = self.gallery(clips, settings)?;
        let key = match settings.layout {
            Layout::Isomap(_) => [f64::from(settings.gamma), settings.ridge],
            Layout::Pca => [0.0; 2],
        };
        let known = |embedded: &Embedded| embedded.gallery == gallery && embedded.key == key;
        if let Some(index) = self.embedded.iter().position(known) {
            return Ok(index);
        }
        let laid_out = &self.galleries[gallery];
        let map = laid_out.map(settings)?;
        let spread = laid_out.spread();
        let points: Result<Vec<Vec<Array2<f32>>>, EmbeddingError> = clips
            .par_iter()
            .map(|clip| clip.views.iter().map(|track| map.points(track, spread)).collect())
            .collect();
        self.embedded.push(Embedded { gallery, key, map, spread, points: points? });
        Ok(self.embedded.len() - 1)
    }

    fn gallery(&mut self, clips: &[&Clip], settings: &SpaceSettings) -> Result<usize, EmbeddingError> {
        // Codebooks use distances only: coarse silhouettes improve known sets slightly (fused, 0 to 3 points
        // on two public sets), but worsen others (by up to 15).
        let width = if settings.pattern == PatternKind::Network { ANGLES + CELLS } else { ANGLES };
        let key = (settings.layout, settings.dimensions, settings.gallery, width);
        if let Some(index) = self.galleries.iter().position(|gallery| gallery.key == key) {
            return Ok(index);
        }
        let tracks: Vec<&Track> = clips.iter().flat_map(|clip| &clip.views).collect();
        let samples = evenly(&tracks, settings.gallery, width);
        self.galleries.push(Gallery::new(samples, settings, key)?);
        Ok(self.galleries.len() - 1)
    }
}

#[derive(Debug)]
struct Embedded {
    gallery: usize,
    /// Coefficient and ridge of an RBF map.
    key: [f64; 2],
    map: Map,
    spread: f32,
    points: Vec<Vec<Array2<f32>>>,
}

impl Map {
    fn points(&self, track: &Track, spread: f32) -> Result<Array2<f32>, EmbeddingError> {
        let points = match self {
            Self::Rbf(rbf) => rbf.embed_all(track.descriptors.view())?,
            Self::Pca(pca) if pca.mean.len() == ANGLES => pca.transform(track.descriptors.view())?,
            Self::Pca(pca) => pca.transform(evenly(&[track], track.frames(), pca.mean.len()).view())?,
        };
        Ok(points / spread)
    }
}

impl Gallery {
    fn new(
        samples: Array2<f32>,
        settings: &SpaceSettings,
        key: (Layout, usize, usize, usize),
    ) -> Result<Self, EmbeddingError> {
        let Layout::Isomap(least) = settings.layout else {
            let pca = Pca::fit(samples.view(), settings.dimensions)?;
            let coordinates = pca.transform(samples.view())?;
            return Ok(Self { key, samples, coordinates, pca: Some(pca), neighbours: 0 });
        };
        let mut neighbours = least.clamp(1, samples.nrows().saturating_sub(1).max(1));
        let coordinates = loop {
            let tried = if samples.nrows() > LARGE {
                landmark_isomap(samples.view(), neighbours, 500, settings.dimensions)
                    .map(|laid_out| laid_out.coordinates)
            } else {
                isomap(samples.view(), neighbours, settings.dimensions).map(|laid_out| laid_out.coordinates)
            };
            match tried {
                Err(EmbeddingError::Disconnected { .. }) if 2 * neighbours < samples.nrows() => {
                    neighbours *= 2
                }
                other => break other?,
            }
        };
        Ok(Self { key, samples, coordinates, pca: None, neighbours })
    }

    fn spread(&self) -> f32 {
        let first = self.coordinates.column(0);
        let count = first.len().max(1) as f32;
        let mean = first.sum() / count;
        (first.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / count).sqrt().max(1e-6)
    }

    fn map(&self, settings: &SpaceSettings) -> Result<Map, EmbeddingError> {
        if let Some(pca) = &self.pca {
            return Ok(Map::Pca(pca.clone()));
        }
        // Landmarks place all samples; fewer centres keep an embedding within microseconds.
        let step = self.samples.nrows().div_ceil(LARGE).max(1);
        let rbf = Rbf::train(
            self.samples.slice(s![..;step, ..]),
            self.coordinates.slice(s![..;step, ..]),
            settings.gamma,
            settings.ridge,
        )?;
        Ok(Map::Rbf(rbf))
    }
}
