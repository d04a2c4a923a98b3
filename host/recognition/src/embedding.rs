//! From silhouettes to points in few dimensions (Li 2014, section 9.3.1): [`descriptor`] describes a mask,
//! [`isomap`], [`landmark`] (large galleries) or [`pca`] lay out a gallery, [`rbf`] embeds new silhouettes.
//! Matrices are row-major, one sample per row. Uses the current rayon pool.

pub mod descriptor;
pub mod geodesic;
pub mod isomap;
pub mod landmark;
pub mod neighbours;
pub mod pca;
pub mod rbf;
pub(crate) mod spectral;

use ndarray::{Array2, ArrayView2};

/// Why an embedding failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EmbeddingError {
    #[error("stopped before the embedding was made")]
    Stopped,
    #[error("{found} samples are too few: {needed} are needed")]
    TooFewSamples { found: usize, needed: usize },
    #[error("sample {row} holds a value that is not finite")]
    NotFinite { row: usize },
    #[error("the neighbour graph falls into {} parts ({}); raise the number of neighbours (now the {neighbours} nearest), or remove the separate samples", .components.len(), describe(.components))]
    Disconnected {
        /// Samples of each part, largest first.
        components: Vec<Vec<usize>>,
        neighbours: usize,
    },
    #[error(
        "only {found} eigenvalues are positive, but {asked} dimensions were requested: use at most {found}"
    )]
    TooFewDimensions { found: usize, asked: usize },
    #[error(
        "the RBF system is singular with ridge {ridge}: raise it (1e-4 to 1e-2 are usual) or remove duplicate samples"
    )]
    Singular { ridge: f64 },
    #[error("{name} is {value}: expected 0 or more")]
    Parameter { name: &'static str, value: f64 },
    #[error("{what}: expected {expected}, found {found}")]
    Shape { what: &'static str, expected: usize, found: usize },
}

fn describe(components: &[Vec<usize>]) -> String {
    const SHOWN: usize = 4;
    let mut text: Vec<String> = components
        .iter()
        .take(SHOWN)
        .map(|members| match members.as_slice() {
            [only] => format!("sample {only} alone"),
            [first, second] => format!("samples {first} and {second}"),
            [first, second, ..] => format!("{} samples from {first}, {second} on", members.len()),
            [] => String::from("empty"),
        })
        .collect();
    if components.len() > SHOWN {
        text.push(format!("and {} more", components.len() - SHOWN));
    }
    text.join("; ")
}

fn check(samples: ArrayView2<f32>, needed: usize) -> Result<(), EmbeddingError> {
    if samples.nrows() < needed {
        return Err(EmbeddingError::TooFewSamples { found: samples.nrows(), needed });
    }
    match samples.rows().into_iter().position(|row| row.iter().any(|v| !v.is_finite())) {
        Some(row) => Err(EmbeddingError::NotFinite { row }),
        None => Ok(()),
    }
}

/// `a b^T` of row-major matrices on the current rayon pool.
pub(crate) fn times_transposed(a: ArrayView2<f32>, b: ArrayView2<f32>) -> Array2<f32> {
    let (a, b) = (a.as_standard_layout(), b.as_standard_layout());
    let mut product = Array2::<f32>::zeros((a.nrows(), b.nrows()));
    if let (Some(left), Some(right)) = (a.as_slice(), b.as_slice()) {
        let (rows, columns) = product.dim();
        if let Some(out) = product.as_slice_mut() {
            faer::linalg::matmul::matmul(
                faer::MatMut::from_row_major_slice_mut(out, rows, columns),
                faer::Accum::Replace,
                faer::MatRef::from_row_major_slice(left, a.nrows(), a.ncols()),
                faer::MatRef::from_row_major_slice(right, b.nrows(), b.ncols()).transpose(),
                1.0,
                faer::Par::rayon(0),
            );
        }
    }
    product
}

pub(crate) fn squared_norms(samples: ArrayView2<f32>) -> Vec<f32> {
    samples.rows().into_iter().map(|row| row.iter().map(|v| v * v).sum()).collect()
}

/// Eight partial sums, so that it vectorises.
#[inline(always)]
pub(crate) fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += (a[k] - b[k]) * (a[k] - b[k]);
        }
    }
    let rest = a.chunks_exact(8).remainder().iter().zip(b.chunks_exact(8).remainder());
    sums.iter().sum::<f32>() + rest.map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
}
