//! Trains a model on samples of masks.

use std::{path::PathBuf, time::Instant};

use farnear_files::staging;
use farnear_recognition::choice::names;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::model::Recogniser;
use farnear_recognition::space::{Map, PatternKind};
use serde::Serialize;

use super::{
    method::Method,
    motion::{self, MotionSettings},
    samples::{SCALING, Samples},
    training_progress,
};
use crate::{
    context::Context,
    error::{About, Result},
    figures::rounded,
    parameters::at_least,
};

const WINDOW_MIN: usize = 5;

#[derive(Clone, PartialEq, Debug)]
pub struct TrainingSettings {
    pub samples: Option<PathBuf>,
    /// Motion files as additional or only training data; every view is a separate clip.
    pub motion: Option<MotionSettings>,
    pub out: PathBuf,
    pub method: Method,
    /// Cut clips into windows of this many frames, at least 5: for un-segmented recordings.
    pub window: Option<usize>,
    /// Use every view as a separate clip, so that the model recognises single views.
    pub any_view: bool,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TrainingFigures {
    pub clips: usize,
    pub subjects: usize,
    pub activities: usize,
    pub views: usize,
    pub frames: usize,
    pub empty_frames: usize,
    /// Whether masks are full frames, so that motion of the bounding box is learned.
    pub full_frames: bool,
    pub mode: &'static str,
    pub layout: String,
    pub pattern: String,
    /// Of the Gaussians of the RBF map.
    pub gamma: Option<f32>,
    /// Of the RBF map's system.
    pub condition_number: Option<f64>,
    /// Accuracy in the cross-validation that chose the settings.
    pub inner_accuracy: Option<f64>,
    pub seconds: f64,
}

/// With two or more subjects and a search, chooses the settings by cross-validation over subjects.
pub fn train(settings: &TrainingSettings, context: &Context<'_>) -> Result<TrainingFigures> {
    if let Some(window) = settings.window {
        at_least("window", window, WINDOW_MIN, "frames")?;
    }
    let start = Instant::now();
    let learned = Learned::read(settings, context)?;
    let Learned { clips, frames, empty_frames, full_frames, what } = learned;
    let clips: Vec<Clip> = match settings.window {
        Some(length) => clips.iter().flat_map(|clip| clip.windows(length)).collect(),
        None => clips,
    };
    let experiment = settings.method.experiment(full_frames)?;
    let trained =
        Recogniser::train_searched(&clips, &experiment, SCALING, &training_progress::Training::new(context));
    let (model, inner_accuracy) = training_progress::outcome(trained, context, "training").about(|| what)?;
    staging::write_file(&settings.out, &model.to_bytes()?)?;
    context.info(&format!("wrote {}", settings.out.display()));
    let (gamma, condition_number) = match &model.space.map {
        Map::Rbf(rbf) => (Some(rbf.gamma), Some(rbf.condition)),
        Map::Pca(_) => (None, None),
    };
    Ok(TrainingFigures {
        clips: clips.len(),
        subjects: names(clips.iter().map(|clip| &clip.subject)).len(),
        activities: model.activities.len(),
        views: model.views,
        frames,
        empty_frames,
        full_frames,
        mode: settings.method.name(),
        layout: layout(&model),
        pattern: pattern(&model),
        gamma,
        condition_number: condition_number.map(|value| rounded(value, 0)),
        inner_accuracy: inner_accuracy.map(|value| rounded(value, 4)),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

struct Learned {
    clips: Vec<Clip>,
    frames: usize,
    empty_frames: usize,
    full_frames: bool,
    what: String,
}

impl Learned {
    fn read(settings: &TrainingSettings, context: &Context<'_>) -> Result<Self> {
        let mut learned = Self {
            clips: Vec::new(),
            frames: 0,
            empty_frames: 0,
            full_frames: true,
            what: "motion files".into(),
        };
        if let Some(path) = &settings.samples {
            let samples = Samples::read(path, context)?;
            learned.frames = samples.frames;
            learned.empty_frames = samples.empty_frames;
            learned.full_frames = samples.full_frames;
            learned.what = path.display().to_string();
            let apart = settings.any_view || settings.motion.is_some();
            learned.clips = if apart { samples.split() } else { samples.fused()? };
        }
        if let Some(motion) = &settings.motion {
            let mut clips = motion::clips(motion, context)?;
            learned.frames += clips.iter().flat_map(|clip| &clip.views).map(Track::frames).sum::<usize>();
            if !learned.full_frames {
                clips.iter_mut().flat_map(|clip| &mut clip.views).for_each(|view| view.boxes = None);
            }
            learned.clips.extend(clips);
        }
        Ok(learned)
    }
}

fn layout(model: &Recogniser) -> String {
    let dimensions = model.settings.space.dimensions;
    match model.space.neighbours {
        0 => format!("pca:{dimensions}"),
        k => format!("isomap:{dimensions},k={k}"),
    }
}

fn pattern(model: &Recogniser) -> String {
    match &model.settings.space.pattern {
        PatternKind::Thesis(bins) => {
            format!("grid:{}", bins.iter().map(ToString::to_string).collect::<Vec<_>>().join("x"))
        }
        PatternKind::Codebook(size) => format!("codebook:{size}"),
        PatternKind::Network => "network".into(),
    }
}
