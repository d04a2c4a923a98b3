//! Patterns of clips, from views to training rows.

use super::clip::Clip;
use super::space::Space;
use crate::embedding::EmbeddingError;
use ndarray::{Array1, Array2};
use rayon::prelude::*;

pub(crate) fn vectors_of(space: &Space, clips: &[&Clip]) -> Result<Vec<Vec<Array2<f32>>>, EmbeddingError> {
    clips.par_iter().map(|clip| clip.views.iter().map(|view| space.vectors(view)).collect()).collect()
}

pub(crate) fn patterns_of(
    space: &Space,
    clips: &[Vec<Array2<f32>>],
    sharpness: f32,
) -> Vec<Vec<Array1<f32>>> {
    let clip =
        |views: &Vec<Array2<f32>>| views.iter().map(|v| space.pattern_of(v.view(), sharpness)).collect();
    clips.par_iter().map(clip).collect()
}

/// Patterns of the chosen views, one clip per row.
pub(crate) fn gathered(patterns: &[Vec<Array1<f32>>], chosen: &[usize]) -> Array2<f32> {
    rows(&patterns.iter().map(|views| joined(views, chosen)).collect::<Vec<_>>())
}

/// Concatenated patterns over the square root of the number of views, so that costs compare.
pub(crate) fn joined(views: &[Array1<f32>], chosen: &[usize]) -> Array1<f32> {
    let scale = 1.0 / (chosen.len().max(1) as f32).sqrt();
    chosen.iter().flat_map(|&view| views[view].iter().map(move |v| scale * v)).collect()
}

fn rows(patterns: &[Array1<f32>]) -> Array2<f32> {
    let width = patterns.first().map_or(0, Array1::len);
    Array2::from_shape_fn((patterns.len(), width), |(i, j)| patterns[i][j])
}
