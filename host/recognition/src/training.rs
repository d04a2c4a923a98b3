//! Training of a recogniser: settings, classifier, unknown limits.

use super::auxiliary_model::AuxiliaryModel;
use super::choice::{Chosen, Views, choose, names};
use super::classifier::Classifier;
use super::clip::Clip;
use super::experiment::Experiment;
use super::lengths::Lengths;
use super::model::{ModelError, Recogniser, RecogniserSettings, nearest};
use super::patterns::gathered;
use super::unknown::Limits;
use super::watch::{Unwatched, Watch};
use crate::embedding::descriptor::Scaling;
use ndarray::Array2;
use rayon::prelude::*;

impl Recogniser {
    /// Trains with fixed settings. Fails for fewer than two activities or unequal views.
    pub fn train(clips: &[Clip], settings: &RecogniserSettings) -> Result<Self, ModelError> {
        let experiment = Experiment {
            sharpness: vec![settings.sharpness],
            classifiers: vec![settings.classifier],
            mirror: settings.mirror,
            inner_folds: 2,
            ..Experiment::codebook(settings.space.clone())
        };
        Self::train_searched(clips, &experiment, settings.scaling, &Unwatched)
            .map(|(recogniser, _)| recogniser)
    }

    /// Trains with settings chosen by cross-validation over the subjects. Also returns the accuracy over the
    /// folds (slightly optimistic), `None` without alternatives or activities of several subjects. `watch` may stop it.
    pub fn train_searched(
        clips: &[Clip],
        experiment: &Experiment,
        scaling: Scaling,
        watch: &dyn Watch,
    ) -> Result<(Self, Option<f64>), ModelError> {
        Self::train_performances(clips, &[], experiment, scaling, watch)
    }

    /// [`Self::train_searched`] for clips of which several may show one performance (views, windows).
    /// `performances` numbers the performance of each clip; empty if each clip is another. Limits for unknown of a
    /// single subject compare different performances only, and need as many as a limit needs clips.
    pub fn train_performances(
        clips: &[Clip],
        performances: &[usize],
        experiment: &Experiment,
        scaling: Scaling,
        watch: &dyn Watch,
    ) -> Result<(Self, Option<f64>), ModelError> {
        let activities = names(clips.iter().map(|clip| &clip.activity));
        if activities.len() < 2 {
            return Err(ModelError::Activities(activities.len()));
        }
        let (views, boxes) = shape(&clips[0]);
        if views == 0 {
            return Err(ModelError::Clip {
                found: 0,
                found_boxes: false,
                expected: 1,
                expected_boxes: false,
            });
        }
        for clip in clips {
            fits(clip, views, boxes)?;
        }
        let mirrors: Vec<Clip> =
            if experiment.mirror { clips.iter().map(Clip::mirrored).collect() } else { Vec::new() };
        let all: Vec<&Clip> = clips.iter().chain(&mirrors).collect();
        let Chosen { space, sharpness, classifier: kind, inner_accuracy, patterns } =
            choose(&all, &activities, experiment, &[Views::Fused], watch)?;
        let order: Vec<usize> = (0..views).collect();
        let patterns = gathered(&patterns, &order);
        let labels: Vec<usize> =
            all.iter().map(|clip| activities.iter().position(|a| *a == clip.activity).unwrap_or(0)).collect();
        let mut lengths: Vec<usize> = clips.iter().map(|clip| clip.views[0].frames()).collect();
        lengths.sort_unstable();
        let is_single = clips.iter().all(|clip| clip.subject == clips[0].subject);
        let groups: Vec<String> = if is_single {
            (0..clips.len()).map(|clip| performances.get(clip).unwrap_or(&clip).to_string()).collect()
        } else {
            clips.iter().map(|clip| clip.subject.clone()).collect()
        };
        let limited = !is_single || names(groups.iter()).len() >= Limits::fewest(Limits::FALSE_ALARMS);
        let other = experiment.second.clone();
        let second =
            other.map(|other| AuxiliaryModel::learned(other, clips, &groups, &labels, activities.len()));
        let mut second = second.transpose()?;
        if let Some(second) = second.as_mut().filter(|_| !limited) {
            second.limits = Limits::none(activities.len());
        }
        let recogniser = Self {
            typical_frames: lengths[lengths.len() / 2],
            limits: if limited {
                limits(&groups, &labels, activities.len(), &patterns)
            } else {
                Limits::none(activities.len())
            },
            settings: RecogniserSettings {
                scaling,
                space: space.settings.clone(),
                sharpness,
                classifier: kind,
                mirror: experiment.mirror,
            },
            classifier: Classifier::train(kind, patterns.view(), &labels, activities.len()),
            lengths: Lengths::of(clips, &activities),
            activities,
            views,
            space,
            patterns,
            labels,
            second,
            among: Vec::new(),
        };
        Ok((recogniser, inner_accuracy))
    }
}

fn shape(clip: &Clip) -> (usize, bool) {
    (clip.views.len(), clip.views.iter().all(|view| view.boxes.is_some()))
}

fn fits(clip: &Clip, expected: usize, expected_boxes: bool) -> Result<(), ModelError> {
    let (found, found_boxes) = shape(clip);
    if (found, found_boxes) == (expected, expected_boxes) {
        return Ok(());
    }
    Err(ModelError::Clip { found, found_boxes, expected, expected_boxes })
}

/// Unknown limits: every clip is compared with all patterns of other groups (subjects, or performances of a single one).
/// Mirrors, if trained on, follow the clips; `patterns` are in the same order.
fn limits(groups: &[String], labels: &[usize], classes: usize, patterns: &Array2<f32>) -> Limits {
    let scored: Vec<(usize, f32)> = (0..groups.len())
        .into_par_iter()
        .filter_map(|i| {
            let other = |j: usize| groups[j % groups.len()] != groups[i];
            // Classes of a single group have no comparison.
            (0..groups.len()).find(|j| labels[*j] == labels[i] && other(*j))?;
            let others =
                patterns.rows().into_iter().enumerate().filter(|(j, _)| other(*j)).map(|(_, row)| row);
            Some((labels[i], nearest(others, patterns.row(i))))
        })
        .collect();
    Limits::conformal(&scored, classes, Limits::FALSE_ALARMS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Track;
    use crate::embedding::descriptor::{ANGLES, CELLS};
    use crate::space::SpaceSettings;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Performances of two activities by one subject, each there several times, with their numbers.
    fn copies(performances: usize, count: usize) -> (Vec<Clip>, Vec<usize>) {
        let mut rng = ChaCha8Rng::seed_from_u64(21);
        let (mut clips, mut numbers) = (Vec::new(), Vec::new());
        for number in 0..performances {
            let (phase, size) = (rng.random_range(0.0..6.0_f32), rng.random_range(0.05..0.15_f32));
            let descriptors = Array2::from_shape_fn((20, ANGLES), |(frame, angle)| {
                let waves = (number % 2 + 2) as f32 * (angle as f32).to_radians();
                let noise = rng.random_range(-0.01..0.01_f32);
                0.35 + size * (waves + 0.2 * frame as f32 + phase).sin() + noise
            });
            let view = Track { descriptors, cells: Array2::zeros((20, CELLS)), boxes: None, empty_frames: 0 };
            let activity = ["turn", "star"][number % 2].to_owned();
            for _ in 0..count {
                let (activity, views) = (activity.clone(), vec![view.clone()]);
                clips.push(Clip { subject: "ben".into(), activity, views });
                numbers.push(number);
            }
        }
        (clips, numbers)
    }

    fn distances(clips: &[Clip], performances: &[usize]) -> Vec<f32> {
        let experiment = Experiment::codebook(SpaceSettings::small()).fixed();
        let scaling = Scaling::default();
        let trained = Recogniser::train_performances(clips, performances, &experiment, scaling, &Unwatched);
        trained.expect("trained").0.limits.distances
    }

    #[test]
    fn an_activity_of_one_subject_of_several_takes_the_limit_of_the_others() {
        let (mut clips, _) = copies(40, 1);
        // Half of the clips of one activity; the other is the first subject's alone.
        clips.iter_mut().step_by(4).for_each(|clip| clip.subject = "ann".into());
        let found = distances(&clips, &[]);
        assert!(found[0] == found[1] && found[0].is_finite(), "{found:?}");
    }

    #[test]
    fn a_model_tells_the_clips_that_it_has_learned() {
        let (clips, _) = copies(6, 1);
        let settings = RecogniserSettings { space: SpaceSettings::small(), ..RecogniserSettings::default() };
        let model = Recogniser::train(&clips[..4], &settings).expect("trained");
        let learned: Vec<bool> =
            clips.iter().map(|clip| model.has_learned(&clip.views).expect("fits")).collect();
        assert_eq!(learned, [true, true, true, true, false, false]);
        let both = [clips[5].views[0].clone(), clips[0].views[0].clone()];
        assert_eq!(model.has_learned(&both), Ok(true));
    }

    #[test]
    fn limits_of_a_single_subject_come_from_different_performances() {
        let (clips, numbers) = copies(20, 2);
        // A copy is at distance 0.
        assert!(distances(&clips, &[]).iter().all(|limit| *limit < 1e-6));
        let found = distances(&clips, &numbers);
        assert!(found.iter().all(|limit| *limit > 1e-6 && limit.is_finite()), "{found:?}");
        // Many clips, but fewer than 19 performances: nothing is unknown.
        let (clips, numbers) = copies(2, 24);
        assert!(distances(&clips, &numbers).iter().all(|limit| limit.is_infinite()));
    }
}
