//! Focus measures: one number per image, largest for the sharpest image.
//!
//! | measure | what | cost |
//! |---|---|---|
//! | [`FocusMeasure::FftSum`] | sum of the magnitudes of the highest frequencies (Li 2014, eq. 4.5) | one FFT |
//! | [`FocusMeasure::Tenengrad`] | mean squared Sobel gradient (Krotkov 1987) | 16 operations a pixel |
//! | [`FocusMeasure::ModifiedLaplacian`] | mean magnitude of both second differences (Nayar & Nakagawa 1994) | 8 |
//!
//! Eq. 4.5 sums the first quarter of the spectrum's rows and columns. With the zero frequency in the middle, as in a
//! displayed spectrum, these are pi/2 to pi rad/px in both directions, "the high-frequency components" of its text; FFT
//! order would give the lowest. The last two are divided by the image's (squared) mean, so that a flickering lamp does
//! not look like focus. [`peak`] interpolates the best focus of a sweep by a parabola.

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::fourier::{Complex64, transform};

/// Smallest side of a usable image.
pub(crate) const SMALLEST_PX: usize = 8;

/// Name of the measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FocusMeasure {
    /// Sum of high-frequency magnitudes.
    FftSum,
    /// Squared gradient.
    Tenengrad,
    /// Second differences.
    ModifiedLaplacian,
}

/// Why an image has no focus measure.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum FocusError {
    #[error("`{0}` is not a focus measure: use fft-sum, tenengrad or modified-laplacian")]
    Unknown(String),
    #[error("an image of {width}x{height} px: at least 8x8 are needed")]
    TooSmall { width: usize, height: usize },
    #[error("the pixel in column {column}, row {row} is not finite")]
    NotFinite { column: usize, row: usize },
    #[error("the image is too dark to focus (mean {0})")]
    Dark(f64),
}

impl FocusMeasure {
    /// All measures.
    pub const ALL: [Self; 3] = [Self::FftSum, Self::Tenengrad, Self::ModifiedLaplacian];

    /// The name as the command line writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::FftSum => "fft-sum",
            Self::Tenengrad => "tenengrad",
            Self::ModifiedLaplacian => "modified-laplacian",
        }
    }

    /// The measure of an image in any scale. Returns [`FocusError`] if it is too small, dark, or not finite.
    pub fn of(self, image: ArrayView2<f32>) -> Result<f64, FocusError> {
        let (height, width) = image.dim();
        if height < SMALLEST_PX || width < SMALLEST_PX {
            return Err(FocusError::TooSmall { width, height });
        }
        if let Some(((row, column), _)) = image.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(FocusError::NotFinite { column, row });
        }
        let mean = image.iter().map(|v| f64::from(*v)).sum::<f64>() / image.len() as f64;
        if mean <= 0.0 {
            return Err(FocusError::Dark(mean));
        }
        Ok(match self {
            Self::FftSum => fft_sum(image),
            Self::Tenengrad => tenengrad(image) / (mean * mean),
            Self::ModifiedLaplacian => modified_laplacian(image) / mean,
        })
    }
}

impl fmt::Display for FocusMeasure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FocusMeasure {
    type Err = FocusError;

    fn from_str(text: &str) -> Result<Self, FocusError> {
        let known = Self::ALL.into_iter().find(|measure| measure.name() == text.trim());
        known.ok_or_else(|| FocusError::Unknown(text.to_owned()))
    }
}

fn fft_sum(image: ArrayView2<f32>) -> f64 {
    let (height, width) = image.dim();
    let spectrum = transform(image.mapv(|v| Complex64::new(f64::from(v), 0.0)));
    // With the zero frequency shifted to the middle, shifted row r is row (r + ceil(height / 2)) mod height.
    let unshifted = |index: usize, length: usize| (index + length.div_ceil(2)) % length;
    let rows = (0..height / 4).map(|row| unshifted(row, height));
    rows.map(|row| (0..width / 4).map(|column| spectrum[(row, unshifted(column, width))].norm()).sum::<f64>())
        .sum()
}

/// Without neighbourhoods of pixels that are not finite.
fn mean_of_neighbourhoods(image: ArrayView2<f32>, f: impl Fn(&[[f32; 3]; 3]) -> f32) -> f64 {
    let image: Array2<f32> = image.as_standard_layout().into_owned();
    let (height, width) = image.dim();
    let (mut sum, mut seen) = (0.0, 0_u64);
    for row in 1..height - 1 {
        let rows: [_; 3] = std::array::from_fn(|i| image.row(row + i - 1));
        let (mut of_row, mut seen_of_row) = (0.0_f32, 0_u32);
        for column in 1..width - 1 {
            let at = |i: usize| [rows[i][column - 1], rows[i][column], rows[i][column + 1]];
            let value = f(&[at(0), at(1), at(2)]);
            of_row += if value.is_finite() { value } else { 0.0 };
            seen_of_row += u32::from(value.is_finite());
        }
        sum += f64::from(of_row);
        seen += u64::from(seen_of_row);
    }
    sum / seen as f64
}

/// Mean squared gradient.
pub(crate) fn tenengrad(image: ArrayView2<f32>) -> f64 {
    mean_of_neighbourhoods(image, |[a, b, c]| {
        let x = (a[2] + 2.0 * b[2] + c[2]) - (a[0] + 2.0 * b[0] + c[0]);
        let y = (c[0] + 2.0 * c[1] + c[2]) - (a[0] + 2.0 * a[1] + a[2]);
        x * x + y * y
    })
}

fn modified_laplacian(image: ArrayView2<f32>) -> f64 {
    mean_of_neighbourhoods(image, |[a, b, c]| {
        (2.0 * b[1] - b[0] - b[2]).abs() + (2.0 * b[1] - a[1] - c[1]).abs()
    })
}

/// The peak of a measure in a sweep: the tip of the least-squares parabola through the largest value and up to two
/// neighbours on either side. `None` for fewer than three places, non-finite values, or a maximum at an end.
pub fn peak(places: &[f64], values: &[f64]) -> Option<f64> {
    let count = places.len().min(values.len());
    if count < 3 || !values[..count].iter().chain(&places[..count]).all(|v| v.is_finite()) {
        return None;
    }
    let largest = (0..count).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    if largest == 0 || largest == count - 1 {
        return None;
    }
    let reach = 2.min(largest).min(count - 1 - largest);
    let window = largest - reach..=largest + reach;
    // Least squares of v = a + b t + c t^2, t from the largest value.
    let unit = (places[largest + 1] - places[largest - 1]) / 2.0;
    let mut matrix = nalgebra::Matrix3::zeros();
    let mut right = nalgebra::Vector3::zeros();
    for i in window {
        let t = (places[i] - places[largest]) / unit;
        let powers = nalgebra::Vector3::new(1.0, t, t * t);
        matrix += powers * powers.transpose();
        right += powers * (values[i] / values[largest]);
    }
    let solution = matrix.lu().solve(&right)?;
    let (b, c) = (solution[1], solution[2]);
    // A maximum outside the neighbours does not belong to this peak.
    let tip = -b / (2.0 * c);
    (c < 0.0 && tip.abs() <= 1.0).then_some(places[largest] + unit * tip)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stripes(period: f64) -> Array2<f32> {
        Array2::from_shape_fn((64, 64), |(row, column)| {
            (100.0 + 50.0 * (std::f64::consts::TAU * (row + column) as f64 / period).sin()) as f32
        })
    }

    #[test]
    fn the_sum_of_eq_4_5_sees_high_frequencies_only() {
        // The diagonal stripes have 2 pi / period in both directions.
        let high = FocusMeasure::FftSum.of(stripes(3.0).view()).unwrap();
        let low = FocusMeasure::FftSum.of(stripes(16.0).view()).unwrap();
        assert!(high > 1e5 && low < 1e-2 * high, "{high} {low}");
    }

    #[test]
    fn gradients_and_second_differences_of_a_ramp_and_a_ridge() {
        let ramp = Array2::from_shape_fn((10, 10), |(_, column)| 1.0 + column as f32);
        let mean = 5.5_f64;
        let tenengrad = FocusMeasure::Tenengrad.of(ramp.view()).unwrap();
        assert!((tenengrad - 64.0 / (mean * mean)).abs() < 1e-6);
        assert_eq!(FocusMeasure::ModifiedLaplacian.of(ramp.view()).unwrap(), 0.0);
        let ridge = Array2::from_shape_fn((10, 10), |(row, _)| if row == 5 { 2.0 } else { 1.0 });
        // Of the eight inner rows one has a second difference of 2 and two have one of 1.
        let expected = 4.0 / 8.0 / 1.1;
        assert!((FocusMeasure::ModifiedLaplacian.of(ridge.view()).unwrap() - expected).abs() < 1e-6);
    }

    #[test]
    fn the_tip_of_a_parabola_is_found_between_the_steps() {
        let places: Vec<f64> = (0..9).map(|i| 10.0 * f64::from(i)).collect();
        let values: Vec<f64> = places.iter().map(|p| 5.0 - 0.001 * (p - 43.7).powi(2)).collect();
        assert!((peak(&places, &values).unwrap() - 43.7).abs() < 1e-9);
        assert_eq!(peak(&places[5..], &values[5..]), None);
        assert_eq!(peak(&places[..2], &values[..2]), None);
        assert_eq!(peak(&places, &[f64::NAN; 9]), None);
    }

    #[test]
    fn unusable_images_are_rejected_with_a_reason() {
        let measure = FocusMeasure::Tenengrad;
        assert_eq!("tenengrad".parse::<FocusMeasure>().unwrap(), measure);
        assert!("sharpness".parse::<FocusMeasure>().is_err());
        let image = Array2::<f32>::ones((7, 20));
        assert_eq!(measure.of(image.view()), Err(FocusError::TooSmall { width: 20, height: 7 }));
        let mut image = Array2::<f32>::ones((20, 20));
        image[(3, 4)] = f32::NAN;
        assert_eq!(measure.of(image.view()), Err(FocusError::NotFinite { column: 4, row: 3 }));
        assert_eq!(measure.of(Array2::zeros((20, 20)).view()), Err(FocusError::Dark(0.0)));
    }
}
