//! Spectra of images and their products in rings of equal frequency.

use std::f64::consts::PI;

use ndarray::{Array2, ArrayView2};

use crate::fourier::{Complex64, transform};

const SMALLEST_PX: usize = 32;

/// Compared frequencies, rad/px. Below, lighting differs more than blur; above, little is left but aliases.
const BAND: [f64; 2] = [0.1, 2.0];

const RINGS: usize = 128;

/// Why an image has no usable spectrum.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum SpectrumError {
    #[error("{width}x{height} px are too few, at least 32x32 are needed")]
    TooSmall { width: usize, height: usize },
    #[error("the pixel in column {column}, row {row} has no value (NaN or transparent): crop or fill it")]
    NotFinite { column: usize, row: usize },
    #[error("it is constant or dark, without texture to compare")]
    Constant,
}

/// Spectrum of an image divided by its mean, minus 1, under a Hann window.
pub(super) fn windowed(image: ArrayView2<f32>) -> Result<Array2<Complex64>, SpectrumError> {
    let (height, width) = image.dim();
    if height < SMALLEST_PX || width < SMALLEST_PX {
        return Err(SpectrumError::TooSmall { width, height });
    }
    if let Some(((row, column), _)) = image.indexed_iter().find(|(_, v)| !v.is_finite()) {
        return Err(SpectrumError::NotFinite { column, row });
    }
    let hann = |length: usize| -> Vec<f64> {
        (0..length).map(|i| (PI * (i as f64 + 0.5) / length as f64).sin().powi(2)).collect()
    };
    let (of_rows, of_columns) = (hann(height), hann(width));
    let window = |(row, column): (usize, usize)| of_rows[row] * of_columns[column];
    let (mut sum, mut weight) = (0.0, 0.0);
    for (place, value) in image.indexed_iter() {
        sum += window(place) * f64::from(*value);
        weight += window(place);
    }
    let mean = sum / weight;
    let first = image[(0, 0)];
    if mean <= 0.0 || image.iter().all(|v| *v == first) {
        return Err(SpectrumError::Constant);
    }
    Ok(transform(Array2::from_shape_fn((height, width), |place| {
        Complex64::new(window(place) * (f64::from(image[place]) / mean - 1.0), 0.0)
    })))
}

#[derive(Clone, Copy, Default)]
pub(super) struct Ring {
    pub frequency: f64,
    pub far: f64,
    pub near: f64,
    pub cross: f64,
    pub count: f64,
}

pub(super) struct Bins {
    pub rings: Vec<Ring>,
}

impl Bins {
    pub(super) fn new(far: &Array2<Complex64>, near: &Array2<Complex64>) -> Self {
        let (height, width) = far.dim();
        let frequency = |index: usize, length: usize| {
            let index = if 2 * index > length { index as f64 - length as f64 } else { index as f64 };
            2.0 * PI * index / length as f64
        };
        let mut rings = vec![Ring::default(); RINGS];
        let mut counts = vec![0.0; RINGS];
        for (((row, column), far), near) in far.indexed_iter().zip(near) {
            let w = frequency(row, height).hypot(frequency(column, width));
            let ring = (w - BAND[0]) / (BAND[1] - BAND[0]) * RINGS as f64;
            if (0.0..RINGS as f64).contains(&ring) {
                let ring = ring as usize;
                counts[ring] += 1.0;
                rings[ring].frequency += w;
                rings[ring].far += far.norm_sqr();
                rings[ring].near += near.norm_sqr();
                rings[ring].cross += (far * near.conj()).re;
            }
        }
        for (ring, count) in rings.iter_mut().zip(&counts) {
            (ring.frequency, ring.count) = (ring.frequency / count, *count);
        }
        rings.retain(|ring| ring.count > 0.0);
        Self { rings }
    }

    pub(super) fn energy_ratio(&self) -> f64 {
        self.rings.iter().map(|r| r.far).sum::<f64>() / self.rings.iter().map(|r| r.near).sum::<f64>()
    }

    pub(super) fn coefficients(&self) -> f64 {
        self.rings.iter().map(|ring| ring.count).sum()
    }

    pub(super) fn energy(&self) -> f64 {
        self.rings.iter().map(|r| r.far + r.near).sum()
    }
}
