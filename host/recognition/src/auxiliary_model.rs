//! An auxiliary model with many more activities, trained on synthetic people, separates untrained ones better. An
//! activity's profile is the normalised mean of the square roots of the auxiliary model's probabilities over the
//! training clips. A clip's distance is the Bhattacharyya distance, -ln of the scalar product (Kailath, IEEE Trans.
//! Communication Technology 15, 1967). Background clips: Hendrycks et al., ICLR 2019.

use super::clip::Clip;
use super::model::{Answer, ModelError, Recogniser};
use super::unknown::Limits;
use ndarray::{Array1, Array2, ArrayView1};
use rayon::prelude::*;
use std::sync::Arc;

/// Another recogniser with its answers for the trained activities.
#[derive(Clone, Debug, PartialEq)]
pub struct AuxiliaryModel {
    /// Recogniser that describes and answers for clips.
    pub recogniser: Arc<Recogniser>,
    /// Trained x auxiliary activities: square roots, rows of length 1.
    pub profiles: Array2<f32>,
    /// Distance limits per activity; beyond them a clip is unknown.
    pub limits: Limits,
}

impl AuxiliaryModel {
    /// Profiles and conformal limits from the training clips. Each clip is compared with other groups' profile of its
    /// class: of other subjects, or other performances of a single one.
    pub(super) fn learned(
        recogniser: Arc<Recogniser>,
        clips: &[Clip],
        groups: &[String],
        labels: &[usize],
        classes: usize,
    ) -> Result<Self, ModelError> {
        let auxiliary: Vec<Option<Array1<f32>>> =
            clips.par_iter().map(|clip| roots(&recogniser, clip)).collect::<Result<_, ModelError>>()?;
        let width = recogniser.activities.len();
        let profile = |class: usize, of: &dyn Fn(usize) -> bool| {
            let own = (0..auxiliary.len()).filter(|i| labels[*i] == class && of(*i));
            let sum = own
                .filter_map(|i| auxiliary[i].as_ref())
                .fold(Array1::zeros(width), |sum, auxiliary| sum + auxiliary);
            to_unit_length(sum)
        };
        let mut profiles = Array2::zeros((classes, width));
        for (class, mut row) in profiles.rows_mut().into_iter().enumerate() {
            row.assign(&profile(class, &|_| true));
        }
        let scored: Vec<(usize, f32)> = (0..clips.len())
            .into_par_iter()
            .filter_map(|i| {
                let other = |j: usize| groups[j] != groups[i];
                // Classes of a single group have no comparison.
                let others =
                    Some(profile(labels[i], &other)).filter(|sum| sum.iter().any(|root| *root > 0.0))?;
                Some((labels[i], distance(auxiliary[i].as_ref()?.view(), others.view())))
            })
            .collect();
        let limits = Limits::conformal(&scored, classes, Limits::FALSE_ALARMS);
        Ok(Self { recogniser, profiles, limits })
    }

    pub(super) fn outlier_score(&self, auxiliary: &Answer, class: usize) -> f32 {
        self.limits.score(class, distance(roots_of(auxiliary).view(), self.profiles.row(class)))
    }

    pub(super) fn fits(&self, classes: usize, boxes: bool) -> bool {
        self.recogniser.second.is_none()
            && self.recogniser.views == 1
            && (boxes || !self.recogniser.uses_boxes())
            && self.profiles.dim() == (classes, self.recogniser.activities.len())
            && self.limits.distances.len() == classes
    }
}

/// `None` without a visible person.
fn roots(recogniser: &Recogniser, clip: &Clip) -> Result<Option<Array1<f32>>, ModelError> {
    let auxiliary = recogniser.recognise(&clip.views)?;
    Ok(auxiliary.outlier_score.is_finite().then(|| roots_of(&auxiliary)))
}

fn roots_of(auxiliary: &Answer) -> Array1<f32> {
    auxiliary.probabilities.iter().map(|(_, probability)| probability.max(0.0).sqrt()).collect()
}

fn to_unit_length(sum: Array1<f32>) -> Array1<f32> {
    let length = sum.dot(&sum).sqrt();
    if length > 0.0 { sum / length } else { sum }
}

/// Bhattacharyya distance of square roots of probabilities, limited to a finite maximum.
fn distance(auxiliary: ArrayView1<f32>, profile: ArrayView1<f32>) -> f32 {
    -auxiliary.dot(&profile).clamp(1e-9, 1.0).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_bhattacharyyas() {
        let of = |probabilities: [f32; 3]| -> Array1<f32> {
            probabilities.iter().map(|probability| probability.sqrt()).collect()
        };
        let same = distance(of([0.5, 0.3, 0.2]).view(), of([0.5, 0.3, 0.2]).view());
        assert!(same.abs() < 1e-6, "{same}"); // rounding
        // By hand: -ln(sqrt(0.5 * 0.2) + sqrt(0.3 * 0.3) + sqrt(0.2 * 0.5)) = 0.06993.
        let apart = distance(of([0.5, 0.3, 0.2]).view(), of([0.2, 0.3, 0.5]).view());
        assert!((apart - 0.069_93).abs() < 1e-4, "{apart}");
        let nothing = distance(of([1.0, 0.0, 0.0]).view(), of([0.0, 0.0, 1.0]).view());
        assert!(nothing.is_finite() && nothing > 20.0, "{nothing}");
        assert_eq!(to_unit_length(Array1::zeros(3)), Array1::<f32>::zeros(3));
    }
}
