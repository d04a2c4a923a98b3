//! The learned part before the classifier: how frames are embedded and clips become patterns.

use super::clip::{Clip, Track};
use super::codebook::{Codebook, stacked};
use super::frames::{self, Mode, Weights};
use super::occupancy::OccupancyGrid;
use crate::embedding::EmbeddingError;
use crate::embedding::isomap::isomap;
use crate::embedding::landmark::landmark_isomap;
use crate::embedding::neighbours::Neighbourhood;
use crate::embedding::pca::Pca;
use crate::embedding::rbf::Rbf;
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How the gallery is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Isomap with at least this many neighbours: doubled until the graph holds together.
    Isomap(usize),
    /// Principal components.
    Pca,
}

/// How a clip becomes a pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PatternKind {
    /// Visited cells of a grid, exactly as in Li 2014: members per dimension.
    Thesis(Vec<usize>),
    /// Square-rooted mean shares over a codebook of this size.
    Codebook(usize),
}

/// Everything that is chosen before patterns exist.
///
/// The default lays frames out by twenty principal components: they need no neighbour graph that could fall apart, and in trials
/// with the codebook they recognised at least as much as six Isomap dimensions. Those trials, and the default weights, were
/// made on public sets of skeletons, so accuracies reported for the same sets are on the optimistic side.
/// [`SpaceSettings::thesis`] keeps Isomap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpaceSettings {
    /// How the gallery is laid out.
    pub layout: Layout,
    /// Dimensions of the embedding.
    pub dimensions: usize,
    /// Silhouettes in the gallery at most.
    pub gallery: usize,
    /// Coefficient of the RBF map.
    pub gamma: f32,
    /// Ridge of the RBF map.
    pub ridge: f64,
    /// How a clip becomes a pattern.
    pub pattern: PatternKind,
    /// Whether the order of frames counts.
    pub mode: Mode,
    /// Parts of a frame's vector against one another.
    pub weights: Weights,
    /// Seed of the clustering.
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
            mode: Mode::OrderFree,
            weights: Weights::default(),
            seed: 1,
        }
    }
}

impl SpaceSettings {
    /// The thesis' choices: three dimensions, 15 x 9 x 9 cells.
    pub fn thesis() -> Self {
        Self {
            layout: Layout::Isomap(12),
            dimensions: 3,
            pattern: PatternKind::Thesis(vec![15, 9, 9]),
            ..Self::default()
        }
    }
}

/// How new silhouettes are embedded.
#[derive(Clone, Debug, PartialEq)]
pub enum Map {
    /// By radial basis functions on the gallery.
    Rbf(Rbf),
    /// By projection.
    Pca(Pca),
}

/// How embedded clips become patterns.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// The thesis' grid.
    Thesis(OccupancyGrid),
    /// A codebook of frame vectors.
    Codebook(Codebook),
}

/// The learned space of frames and patterns.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// What it was learned with.
    pub settings: SpaceSettings,
    /// How silhouettes are embedded.
    pub map: Map,
    /// Spread of the gallery along the first dimension; embedded points are divided by it.
    pub spread: f32,
    /// How clips become patterns.
    pub pattern: Pattern,
    /// Neighbours that the Isomap graph needed, 0 for PCA.
    pub neighbours: usize,
}

impl Space {
    /// Learns from the training clips, all of their views together.
    ///
    /// # Errors
    /// Too few silhouettes, or a gallery that cannot be laid out.
    pub fn train(clips: &[&Clip], settings: &SpaceSettings) -> Result<Self, EmbeddingError> {
        let tracks: Vec<&Track> = clips.iter().flat_map(|clip| &clip.views).collect();
        let all = stacked(tracks.iter().map(|track| track.descriptors.view()));
        let gallery = evenly(all.view(), settings.gallery);
        let (map, coordinates, neighbours) = lay_out(gallery.view(), settings)?;
        let first = coordinates.column(0);
        let mean = first.sum() / first.len().max(1) as f32;
        let spread = (first.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / first.len().max(1) as f32)
            .sqrt()
            .max(1e-6);
        let mut space = Self {
            settings: settings.clone(),
            map,
            spread,
            pattern: Pattern::Thesis(OccupancyGrid { low: Vec::new(), range: Vec::new(), bins: Vec::new() }),
            neighbours,
        };
        space.pattern = match &settings.pattern {
            PatternKind::Thesis(bins) => {
                Pattern::Thesis(OccupancyGrid::new((&coordinates / spread).view(), bins))
            }
            PatternKind::Codebook(size) => {
                let vectors: Result<Vec<Array2<f32>>, EmbeddingError> =
                    tracks.par_iter().map(|track| space.vectors(track)).collect();
                let vectors = vectors?;
                let frames = stacked(vectors.iter().map(|v| v.view()));
                Pattern::Codebook(Codebook::train(frames.view(), *size, settings.seed))
            }
        };
        Ok(space)
    }

    /// Embeds the frames of a track: frames x D, over the gallery's spread.
    ///
    /// # Errors
    /// Descriptors of another length.
    pub fn points(&self, track: &Track) -> Result<Array2<f32>, EmbeddingError> {
        let points = match &self.map {
            Map::Rbf(rbf) => rbf.embed_all(track.descriptors.view())?,
            Map::Pca(pca) => pca.transform(track.descriptors.view())?,
        };
        Ok(points / self.spread)
    }

    /// Frame vectors of a track: what the codebook sees.
    ///
    /// # Errors
    /// Descriptors of another length.
    pub fn vectors(&self, track: &Track) -> Result<Array2<f32>, EmbeddingError> {
        let points = self.points(track)?;
        Ok(match self.settings.pattern {
            PatternKind::Thesis(_) => points,
            PatternKind::Codebook(_) => {
                frames::vectors(points.view(), track, self.settings.mode, self.settings.weights)
            }
        })
    }

    /// The pattern of frame vectors.
    pub fn pattern_of(&self, vectors: ArrayView2<f32>, sharpness: f32) -> Array1<f32> {
        match &self.pattern {
            Pattern::Thesis(grid) => grid.pattern(vectors),
            Pattern::Codebook(book) => book.pattern(vectors, self.settings.mode, sharpness),
        }
    }
}

/// At most `count` rows, evenly spread over all.
fn evenly(all: ArrayView2<f32>, count: usize) -> Array2<f32> {
    let n = all.nrows();
    if n <= count {
        return all.to_owned();
    }
    let rows: Vec<usize> = (0..count).map(|i| (2 * i + 1) * n / (2 * count)).collect();
    all.select(Axis(0), &rows)
}

/// Galleries above this size are laid out by landmarks.
const LARGE: usize = 4000;

fn lay_out(
    gallery: ArrayView2<f32>,
    settings: &SpaceSettings,
) -> Result<(Map, Array2<f32>, usize), EmbeddingError> {
    let Layout::Isomap(least) = settings.layout else {
        let pca = Pca::fit(gallery, settings.dimensions)?;
        let coordinates = pca.transform(gallery)?;
        return Ok((Map::Pca(pca), coordinates, 0));
    };
    let mut neighbours = least.clamp(1, gallery.nrows().saturating_sub(1).max(1));
    let coordinates = loop {
        let near = Neighbourhood::Nearest(neighbours);
        let tried = if gallery.nrows() > LARGE {
            landmark_isomap(gallery, near, 500, settings.dimensions).map(|laid_out| laid_out.coordinates)
        } else {
            isomap(gallery, near, settings.dimensions).map(|laid_out| laid_out.coordinates)
        };
        match tried {
            Err(EmbeddingError::Disconnected { .. }) if 2 * neighbours < gallery.nrows() => neighbours *= 2,
            other => break other?,
        }
    };
    // Landmark placement is for all samples; the map's centres stay few enough to embed a frame in microseconds.
    let step = gallery.nrows().div_ceil(LARGE).max(1);
    let rbf = Rbf::train(
        gallery.slice(s![..;step, ..]),
        coordinates.slice(s![..;step, ..]),
        settings.gamma,
        settings.ridge,
    )?;
    Ok((Map::Rbf(rbf), coordinates, neighbours))
}
