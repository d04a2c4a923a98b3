//! Domain adaptation for clips from other cameras, sensors or bodies than the training clips, without labels.
//!
//! Frame vectors of the target are moved so that their mean, spread or covariance over all clips equal those
//! of the training clips: adaptive statistics (Li et al., Pattern Recognition 80, 2018) or CORAL (Sun et al.,
//! AAAI 2016). Here the target moves to the source, so a trained model is unchanged. Both sides must contain
//! similar activities in similar proportions; one clip is not enough.

use crate::embedding::spectral;
use ndarray::{Array1, Array2, Axis};
use serde::{Deserialize, Serialize};

/// Statistics of the target that are matched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Alignment {
    /// No alignment of frame vectors.
    #[default]
    None,
    /// Mean of each frame number.
    Mean,
    /// Mean and spread of each number.
    Spread,
    /// Mean and covariance of all numbers.
    Coral,
}

farnear_silhouettes::named!(Alignment, "alignment", "none" => None, "mean" => Mean, "spread" => Spread, "coral" => Coral);

/// Mean and covariance of frame vectors, with equal weight per clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Mean per number of a frame.
    pub mean: Array1<f32>,
    /// Covariance (numbers x numbers).
    pub covariance: Array2<f32>,
}

/// Ridge on variances, relative to their mean, so that constant directions are unchanged.
const RIDGE: f32 = 0.1;
const MOST: f32 = 4.0;

impl Statistics {
    /// Statistics of frame vectors (frames x F per clip); `None` without frames.
    pub fn of<'a>(clips: impl Iterator<Item = &'a Array2<f32>> + Clone) -> Option<Self> {
        let clips = clips.filter(|clip| clip.nrows() > 0);
        let (count, width) = (clips.clone().count() as f32, clips.clone().next()?.ncols());
        let mut mean = Array1::<f32>::zeros(width);
        for own in clips.clone().filter_map(|clip| clip.mean_axis(Axis(0))) {
            mean += &(own / count);
        }
        let mut covariance = Array2::<f32>::zeros((width, width));
        for clip in clips {
            let off = clip - &mean;
            covariance += &(off.t().dot(&off) / (count * clip.nrows() as f32));
        }
        Some(Self { mean, covariance })
    }

    /// Map from these statistics to others.
    pub fn to(&self, other: &Self, alignment: Alignment) -> Brought {
        let (from, to) = (self.mean.clone(), other.mean.clone());
        let turn = match alignment {
            Alignment::None => return Brought { from: to.clone(), to, turn: None },
            Alignment::Mean => None,
            Alignment::Spread => {
                let factor = |(own, wanted): (&f32, &f32)| {
                    if *own > 1e-9 { (wanted / own).sqrt().clamp(1.0 / MOST, MOST) } else { 1.0 }
                };
                let factors =
                    self.covariance.diag().iter().zip(other.covariance.diag()).map(factor).collect();
                Some(Array2::from_diag(&Array1::from_vec(factors)))
            }
            Alignment::Coral => {
                Some(power(&ridged(&self.covariance), -0.5).dot(&power(&ridged(&other.covariance), 0.5)))
            }
        };
        Brought { from, to, turn }
    }
}

/// Affine map of frame vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Brought {
    from: Array1<f32>,
    to: Array1<f32>,
    turn: Option<Array2<f32>>,
}

impl Brought {
    /// Maps frame vectors (frames x F).
    pub fn apply(&self, frames: &Array2<f32>) -> Array2<f32> {
        let off = frames - &self.from;
        match &self.turn {
            Some(turn) => off.dot(turn) + &self.to,
            None => off + &self.to,
        }
    }
}

fn ridged(covariance: &Array2<f32>) -> Array2<f32> {
    let width = covariance.nrows();
    let ridge = RIDGE * covariance.diag().sum() / width.max(1) as f32;
    covariance + &(Array2::<f32>::eye(width) * ridge.max(1e-9))
}

fn power(matrix: &Array2<f32>, exponent: f64) -> Array2<f32> {
    let width = matrix.nrows();
    let flat: Vec<f64> = matrix.iter().map(|v| f64::from(*v)).collect();
    let (values, vectors) = spectral::leading(&flat, width, width);
    let mut out = Array2::<f32>::zeros((width, width));
    for (value, vector) in values.iter().zip(&vectors) {
        let raised = value.powf(exponent);
        for i in 0..width {
            for j in 0..width {
                out[[i, j]] += (raised * vector[i] * vector[j]) as f32;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    fn clips(other: bool) -> Vec<Array2<f32>> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        (0..40)
            .map(|n| {
                Array2::from_shape_fn((10 + n, 3), |_| rng.random_range(-1.0..1.0_f32))
                    .rows()
                    .into_iter()
                    .map(|r| {
                        let [a, b, c] = [r[0], r[0] + 0.5 * r[1], 2.0 * r[2]];
                        if other { [3.0 + 2.0 * b, a - 1.0, c + a] } else { [a, b, c] }
                    })
                    .collect::<Vec<_>>()
            })
            .map(|rows| Array2::from_shape_fn((rows.len(), 3), |(i, k)| rows[i][k]))
            .collect()
    }

    #[test]
    fn the_target_gets_the_mean_spread_or_covariance_of_the_training_clips() {
        let (own, target) = (clips(false), clips(true));
        let learned = Statistics::of(own.iter()).expect("frames");
        let seen = Statistics::of(target.iter()).expect("frames");
        let after = |alignment| {
            let brought = seen.to(&learned, alignment);
            let moved: Vec<Array2<f32>> = target.iter().map(|clip| brought.apply(clip)).collect();
            Statistics::of(moved.iter()).expect("frames")
        };
        let off = |a: &Array2<f32>, b: &Array2<f32>| (a - b).iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        for alignment in [Alignment::Mean, Alignment::Spread, Alignment::Coral] {
            let mean = after(alignment).mean;
            assert!((&mean - &learned.mean).iter().all(|v| v.abs() < 1e-4), "{alignment:?} {mean}");
        }
        let spread = after(Alignment::Spread).covariance;
        assert!(spread.diag().iter().zip(learned.covariance.diag()).all(|(a, b)| (a - b).abs() < 1e-3));
        // The ridge prevents an exact match.
        let (plain, coral) = (after(Alignment::Mean).covariance, after(Alignment::Coral).covariance);
        assert!(off(&coral, &learned.covariance) < 0.25 * off(&plain, &learned.covariance), "{coral}");
        assert_eq!(seen.to(&learned, Alignment::None).apply(&target[0]), target[0]);
        assert_eq!(Statistics::of([Array2::zeros((0, 3))].iter()), None);
    }
}
