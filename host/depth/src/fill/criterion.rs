//! Which pixels have too little texture.
//!
//! Two criteria: the texture energy, and Li 2014's, the variance of the ratio `R = (I1 - I2) / (I1 + I2)` (eq. 6.12)
//! over a window (eqs. 6.13 and 6.14) against a threshold of 0.0144. Its inequality (eq. 6.15) is printed inverted: low
//! texture is where the variance is *below*, as its text states. The ratio also varies with blur and vanishes for every
//! surface in the middle of the range, so the second is for comparison only. Cost: a few additions a pixel.

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView2, Zip};
use serde::{Deserialize, Serialize};

use crate::confidence::{LOW_TEXTURE, texture_scale};
use crate::prepare::band::box_mean;

/// The thesis' threshold: a standard deviation of 0.12.
const OF_THESIS: f32 = 0.0144;

/// Criterion of low texture.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum LowTexture {
    /// `energy`: texture energy below [`LOW_TEXTURE`] times its median.
    #[default]
    Energy,
    /// `variance` or `variance:0.0144`: the ratio's variance over a window is below this.
    Variance {
        /// The threshold.
        below: f32,
    },
}

/// Unknown criterion.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a criterion of low texture: use energy, or variance:T where the variance of the ratio of the images, 0 to 1, is below \
     T (the thesis: 0.0144)"
)]
pub struct UnknownCriterion(String);

impl FromStr for LowTexture {
    type Err = UnknownCriterion;

    fn from_str(text: &str) -> Result<Self, UnknownCriterion> {
        let unknown = || UnknownCriterion(text.to_owned());
        match text.trim().split_once(':').unwrap_or((text.trim(), "")) {
            ("energy", "") => Ok(Self::Energy),
            ("variance", "") => Ok(Self::Variance { below: OF_THESIS }),
            ("variance", below) => {
                let below = below.parse().ok().filter(|below: &f32| *below > 0.0 && *below <= 1.0);
                Ok(Self::Variance { below: below.ok_or_else(unknown)? })
            }
            _ => Err(unknown()),
        }
    }
}

impl fmt::Display for LowTexture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Energy => f.write_str("energy"),
            Self::Variance { below } => write!(f, "variance:{below}"),
        }
    }
}

impl TryFrom<String> for LowTexture {
    type Error = UnknownCriterion;

    fn try_from(text: String) -> Result<Self, UnknownCriterion> {
        text.parse()
    }
}

impl From<LowTexture> for String {
    fn from(criterion: LowTexture) -> Self {
        criterion.to_string()
    }
}

impl LowTexture {
    /// Pixels of low texture; false where the energy is NaN. `pair`: far and near, any common scale.
    pub(super) fn mask(
        self,
        texture: ArrayView2<f32>,
        pair: [ArrayView2<f32>; 2],
        window_px: usize,
    ) -> Array2<bool> {
        match self {
            Self::Energy => {
                // Without any texture everything is low: the comparison must hold for 0.
                let low = (LOW_TEXTURE * texture_scale(texture)).max(f32::MIN_POSITIVE);
                texture.mapv(|energy| energy < low)
            }
            Self::Variance { below } => {
                let variance = variance_of_ratio(pair, window_px);
                Zip::from(&variance)
                    .and(texture)
                    .map_collect(|variance, energy| *variance < below && !energy.is_nan())
            }
        }
    }
}

/// Variance of the ratio over square windows; a pixel without light or value counts as even.
fn variance_of_ratio([far, near]: [ArrayView2<f32>; 2], window_px: usize) -> Array2<f32> {
    let ratio = Zip::from(far).and(near).map_collect(|far, near| {
        let ratio = (far - near) / (far + near);
        if far + near > 0.0 && ratio.is_finite() { ratio } else { 0.0 }
    });
    let mean = box_mean(ratio.view(), window_px);
    let square = box_mean(ratio.mapv(|r| r * r).view(), window_px);
    Zip::from(&mean).and(&square).map_collect(|mean, square| (square - mean * mean).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn criteria_are_named() {
        assert_eq!("energy".parse(), Ok(LowTexture::Energy));
        assert_eq!("variance".parse(), Ok(LowTexture::Variance { below: 0.0144 }));
        for text in ["energy", "variance:0.0144", "variance:0.00002"] {
            assert_eq!(text.parse::<LowTexture>().unwrap().to_string(), text);
        }
        for wrong in ["", "entropy", "energy:2", "variance:x", "variance:0", "variance:NaN", "variance:1.5"] {
            let error = wrong.parse::<LowTexture>().unwrap_err().to_string();
            assert!(error.contains("variance:T") && error.contains(wrong), "{error}");
        }
    }

    /// A chequered half whose images differ by a tenth: the ratio is +-0.05 there and its variance 0.0025.
    #[test]
    fn low_is_where_the_ratio_hardly_varies() {
        let checker = |(y, x): (usize, usize)| x >= 20 && (y + x) % 2 == 0;
        let far = Array2::from_shape_fn((24, 40), |at| if checker(at) { 1.1_f32 } else { 1.0 });
        let near = Array2::from_shape_fn((24, 40), |at| if checker(at) { 1.0_f32 } else { 1.1 });
        let variance = variance_of_ratio([far.view(), near.view()], 7);
        assert!(variance[(12, 8)] < 1e-9, "{}", variance[(12, 8)]);
        assert!((variance[(12, 32)] / 0.00227 - 1.0).abs() < 0.02, "{}", variance[(12, 32)]);
        let mut texture = Array2::ones((24, 40));
        texture[(5, 5)] = f32::NAN;
        let mask = |below| LowTexture::Variance { below }.mask(texture.view(), [far.view(), near.view()], 7);
        assert!(mask(1e-3)[(12, 8)] && !mask(1e-3)[(12, 32)] && !mask(1e-3)[(5, 5)]);
        assert!(mask(0.0144).iter().filter(|low| !**low).count() == 1, "the thesis' threshold takes all");
    }
}
