//! Training of a recogniser: settings, classifier, unknown limits.

use super::alignment::Alignment;
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
            space: settings.space.clone(),
            sweeps: Vec::new(),
            sharpness: vec![settings.sharpness],
            classifiers: vec![settings.classifier],
            mirror: settings.mirror,
            inner_folds: 2,
            align: Alignment::None,
            self_training: 0,
            features: None,
            second: None,
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
        let other = experiment.second.clone();
        let second = other
            .map(|other| AuxiliaryModel::learned(other, clips, &labels[..clips.len()], activities.len()));
        let recogniser = Self {
            typical_frames: lengths[lengths.len() / 2],
            limits: limits(&all, &labels, activities.len(), clips.len(), &patterns),
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
            second: second.transpose()?,
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

/// Unknown limits: every clip is compared with all other subjects' patterns, or with a single subject's other
/// clips. Mirrors, if trained on, follow `clips`; `patterns` are in the same order.
fn limits(
    clips: &[&Clip],
    labels: &[usize],
    classes: usize,
    originals: usize,
    patterns: &Array2<f32>,
) -> Limits {
    let alone = clips.iter().all(|clip| clip.subject == clips[0].subject);
    let scored: Vec<(usize, f32)> = (0..originals)
        .into_par_iter()
        .map(|i| {
            let other =
                |j: usize| if alone { j % originals != i } else { clips[j].subject != clips[i].subject };
            let others =
                patterns.rows().into_iter().enumerate().filter(|(j, _)| other(*j)).map(|(_, row)| row);
            (labels[i], nearest(others, patterns.row(i)))
        })
        .collect();
    Limits::conformal(&scored, classes, Limits::FALSE_ALARMS)
}
