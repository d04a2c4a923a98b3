//! Recogniser with a network: trained on thousands of one-view clips, calibrated on other people.

use super::training::{NetworkSettings, train};
use super::variation::{Embedded, varied};
use crate::choice::names;
use crate::classifier::{
    Classifier, ClassifierKind,
    softmax::{Softmax, softmax},
};
use crate::clip::{Clip, Track};
use crate::embedding::{EmbeddingError, descriptor::Scaling};
use crate::lengths::Lengths;
use crate::model::{ModelError, Recogniser, RecogniserSettings, entropy};
use crate::space::{Pattern, PatternKind, Space, SpaceSettings};
use crate::unknown::Limits;
use crate::watch::Watch;
use ndarray::{Array1, Array2};
use rayon::prelude::*;

/// Entropy of real clips compared with synthetic ones at the same share of clips beyond it: 5 % on the
/// average of UTKinect, Florence, strips, KTH walking and MSR Action3D, with equal weights.
const REAL_CLIPS: f32 = 1.3;

impl Recogniser {
    /// Trains a network on one-view clips and their mirrors, calibrated on `others`, clips of different people. Fails
    /// for fewer than two activities, clips without frames or with several views, or a gallery that cannot be laid out.
    pub fn train_network(
        clips: &[Clip],
        others: &[Clip],
        space: &SpaceSettings,
        network: &NetworkSettings,
        scaling: Scaling,
        watch: &dyn Watch,
    ) -> Result<Self, ModelError> {
        let activities = names(clips.iter().map(|clip| &clip.activity));
        if activities.len() < 2 {
            return Err(ModelError::Activities(activities.len()));
        }
        let settings = SpaceSettings { pattern: PatternKind::Network, ..space.clone() };
        let mirrors: Vec<Clip> = clips.iter().map(Clip::mirrored).collect();
        let all: Vec<&Clip> = clips.iter().chain(&mirrors).collect();
        let mut space = Space::train(&all, &settings)?;
        let label = |clip: &Clip| activities.iter().position(|a| *a == clip.activity).unwrap_or(0);
        let labels: Vec<usize> = all.iter().map(|clip| label(clip)).collect();
        let embedded: Vec<Embedded> =
            all.par_iter().map(|clip| embedded(&space, clip)).collect::<Result<_, _>>()?;
        let vectors = |clip: &Embedded| vectors(&space, clip);
        let taught = network;
        let (network, last) = train(&embedded, &vectors, &labels, activities.len(), taught, watch)
            .ok_or(EmbeddingError::Stopped)?;
        let width = network.width();
        space.pattern = Pattern::Network(Box::new(network));
        let mut lengths: Vec<usize> = clips.iter().map(|clip| clip.views[0].frames()).collect();
        lengths.sort_unstable();
        let mut recogniser = Self {
            typical_frames: lengths[lengths.len() / 2],
            limits: Limits::none(activities.len()),
            settings: RecogniserSettings {
                scaling,
                space: settings,
                sharpness: 1.0,
                classifier: ClassifierKind::Softmax(0.0),
                mirror: true,
            },
            classifier: Classifier::Softmax(Softmax {
                weights: last.weights.t().to_owned(),
                offsets: last.offsets,
            }),
            // Self-training made models worse on every tested set, so no pattern is kept for it.
            patterns: Array2::zeros((0, width)),
            labels: Vec::new(),
            second: None,
            among: Vec::new(),
            lengths: Lengths::of(clips, &activities),
            activities,
            views: 1,
            space,
        };
        recogniser.calibrate(others, taught)?;
        Ok(recogniser)
    }

    /// Softmax temperature (Guo et al., ICML 2017) and unknown limits, from varied clips of other people.
    fn calibrate(&mut self, others: &[Clip], taught: &NetworkSettings) -> Result<(), ModelError> {
        let known: Vec<(usize, &Clip)> = others
            .iter()
            .filter_map(|clip| Some((self.activities.iter().position(|a| *a == clip.activity)?, clip)))
            .collect();
        let clips: Vec<Embedded> =
            known.par_iter().map(|(_, clip)| embedded(&self.space, clip)).collect::<Result<_, _>>()?;
        let patterns: Vec<Array1<f32>> = varied(&clips, taught)
            .par_iter()
            .map(|clip| self.space.pattern_of(vectors(&self.space, clip).view(), self.settings.sharpness))
            .collect();
        if let Classifier::Softmax(linear) = &mut self.classifier {
            let decisions: Vec<Vec<f32>> = patterns
                .iter()
                .map(|pattern| (linear.weights.dot(pattern) + &linear.offsets).to_vec())
                .collect();
            let labels: Vec<usize> = known.iter().map(|(label, _)| *label).collect();
            let slope = best_slope(&decisions, &labels);
            linear.weights *= slope;
            linear.offsets *= slope;
        }
        let entropies: Vec<(usize, f32)> = patterns
            .iter()
            .map(|pattern| (0, entropy(self.classifier.probabilities(pattern.view()).into_iter())))
            .collect();
        // One limit for all activities: limits of their own called more clips of new sets unknown.
        let limit = REAL_CLIPS * Limits::conformal(&entropies, 1, Limits::FALSE_ALARMS).distances[0];
        let unknown = entropies.iter().filter(|(_, entropy)| *entropy > limit).count();
        self.limits = Limits {
            distances: vec![limit; self.activities.len()],
            false_alarms: unknown as f32 / entropies.len().max(1) as f32,
        };
        Ok(())
    }
}

fn embedded(space: &Space, clip: &Clip) -> Result<Embedded, ModelError> {
    let view = only_view(clip)?;
    Ok(Embedded { points: space.points(view)?, boxes: view.boxes.clone() })
}

fn vectors(space: &Space, clip: &Embedded) -> Array2<f32> {
    space.vectors_of(clip.points.view(), clip.boxes.as_ref().map(|boxes| boxes.view()))
}

fn only_view(clip: &Clip) -> Result<&Track, ModelError> {
    match clip.views.as_slice() {
        [view] if view.frames() > 0 => Ok(view),
        views => {
            Err(ModelError::Clip { found: views.len(), found_boxes: true, expected: 1, expected_boxes: true })
        }
    }
}

/// Factor on all decisions with the highest likelihood, by golden-section search of its logarithm.
fn best_slope(decisions: &[Vec<f32>], labels: &[usize]) -> f32 {
    let loss = |slope: f32| -> f64 {
        decisions
            .iter()
            .zip(labels)
            .map(|(values, &label)| {
                let mut scaled: Vec<f32> = values.iter().map(|v| slope * v).collect();
                softmax(&mut scaled);
                -f64::from(scaled[label].max(1e-12).ln())
            })
            .sum()
    };
    const GOLDEN: f32 = 0.618_034;
    let (mut low, mut high) = (0.1_f32.ln(), 10.0_f32.ln());
    for _ in 0..30 {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if loss(a.exp()) < loss(b.exp()) { high = b } else { low = a }
    }
    (0.5 * (low + high)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::everyday;
    use crate::watch::Unwatched;

    #[test]
    fn limits_are_set_on_clips_varied_as_in_training() {
        let clips = |first: usize, people: usize| {
            everyday::clips_of(&["walk", "lie down"], first, people, Scaling::default())
        };
        // Twenty clips: one more than a limit needs.
        let (people, others) = (clips(0, 3), clips(9, 10));
        let space = SpaceSettings { dimensions: 4, gallery: 100, ..SpaceSettings::default() };
        let taught = NetworkSettings { widths: [4, 5, 6], passes: 1, ..NetworkSettings::default() };
        let mut model =
            Recogniser::train_network(&people, &others, &space, &taught, Scaling::default(), &Unwatched)
                .expect("trained");
        let as_they_are = model.limits.clone();
        assert!(as_they_are.distances.iter().all(|limit| limit.is_finite()));
        model.calibrate(&others, &NetworkSettings { shift: 3.0, ..taught }).expect("clips that fit");
        let wider = model.limits.distances.iter().zip(&as_they_are.distances);
        assert!(wider.clone().all(|(shifted, limit)| shifted > limit), "{wider:?}");
    }
}
