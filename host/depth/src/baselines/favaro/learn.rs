//! Learning: random textures are rendered at a depth, cut into vectors and decomposed.

use std::f64::consts::PI;

use nalgebra::{DMatrix, SymmetricEigen};
use ndarray::Array2;

use super::{FavaroSettings, VECTOR, fill};
use crate::baselines::BaselineError;
use crate::fourier::{Complex64, transform};
use crate::optics::Optics;
use crate::psf::Otf;

/// Side of a rendered texture (it repeats at its borders).
const SIDE_PX: usize = 128;

const STRIDE_PX: usize = 2;

pub(super) fn signals(
    optics: &Optics,
    alphas: &[f64],
    settings: &FavaroSettings,
) -> Result<Vec<DMatrix<f32>>, BaselineError> {
    let otf = optics.psf().otf(1.2 * optics.max_blur_px());
    let spectrum = spectrum(settings.seed);
    alphas
        .iter()
        .map(|&alpha| {
            let [far, near] = optics.blur_px(alpha).map(|radius_px| render(&spectrum, &otf, radius_px));
            directions(&far, &near, settings.rank).ok_or(BaselineError::NoDirections { alpha })
        })
        .collect()
}

fn frequency(row: usize, column: usize) -> f64 {
    let signed =
        |index: usize| if 2 * index > SIDE_PX { index as f64 - SIDE_PX as f64 } else { index as f64 };
    2.0 * PI / SIDE_PX as f64 * signed(row).hypot(signed(column))
}

/// Spectrum of a random texture: white noise through a pixel, and some 1/f.
fn spectrum(seed: u64) -> Array2<Complex64> {
    let mut state = seed;
    let mut normal = || {
        // SplitMix64; the sum of twelve uniform numbers is normal enough for a texture.
        let mut uniform = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    };
    let noise = Array2::from_shape_simple_fn((SIDE_PX, SIDE_PX), || Complex64::new(normal(), 0.0));
    let mut spectrum = transform(noise);
    for ((row, column), value) in spectrum.indexed_iter_mut() {
        let w = frequency(row, column);
        let grain = (-0.5 * (0.5 * w).powi(2)).exp();
        *value *= if w == 0.0 { 0.0 } else { grain + 0.1 / w };
    }
    spectrum
}

fn render(spectrum: &Array2<Complex64>, otf: &Otf, radius_px: f64) -> Array2<f32> {
    let mut blurred = spectrum.clone();
    for ((row, column), value) in blurred.indexed_iter_mut() {
        *value *= otf.at(radius_px, frequency(row, column));
    }
    // A forward transform of a real image's spectrum gives the image reflected, alike for all images.
    transform(blurred).mapv(|value| (value.re / (SIDE_PX * SIDE_PX) as f64) as f32)
}

/// The largest singular directions of the matrix of all vectors (eigenvectors of its Gram matrix).
fn directions(far: &Array2<f32>, near: &Array2<f32>, rank: usize) -> Option<DMatrix<f32>> {
    let places: Vec<usize> = (0..SIDE_PX - super::PATCH_PX).step_by(STRIDE_PX).collect();
    let mut vectors = DMatrix::<f32>::zeros(VECTOR, places.len() * places.len());
    for (index, mut vector) in vectors.column_iter_mut().enumerate() {
        let place = (places[index / places.len()], places[index % places.len()]);
        fill(vector.as_mut_slice(), far, near, place);
    }
    let gram = (&vectors * vectors.transpose()).cast::<f64>();
    let eigen = SymmetricEigen::try_new(gram, 1e-12, 10_000)?;
    let mut order: Vec<usize> = (0..VECTOR).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    Some(DMatrix::from_fn(rank, VECTOR, |i, j| eigen.eigenvectors[(j, order[i])] as f32))
}
