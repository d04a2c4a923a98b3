//! The task of training: a model from samples of masks or motion files.

use std::{path::PathBuf, time::Instant};

use farnear_files::staging;
use farnear_recognition::choice::names;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::model::Recogniser;
use farnear_recognition::space::{Map, PatternKind};
use farnear_recognition::unknown::Limits;
use farnear_silhouettes::readers::{
    keypoints::aspect::Aspect,
    recording::{Unit, Up},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{
    doubts,
    method::MethodOptions,
    motion::{self, MotionFile},
    samples::{SCALING, Samples},
    training_progress,
};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    figures::rounded,
    parameters::{at_least, within},
    request::{PathKind, Request},
    result_folder,
};

const WINDOW_MIN: usize = 5;

/// Trains a model on samples of masks.
///
/// SAMPLES.toml lists `[[sample]] masks = "dir" subject = "s01" activity = "walk" view = 1` with folders relative to itself.
/// Masks are full frames (the box's motion is learned too) or 100x100 (shapes only). Samples of one performance from several
/// views are fused; give them a common `clip = "name"` where a subject does an activity more than once and the order does not tell.
/// With two or more subjects the settings are chosen by cross-validation over them.
///
/// --motion learns from motion files, alone or with samples: recordings of markers or joints (.c3d, .trc, .bvh, .csv, .skeleton, .txt), or
/// UTKinect's and Florence's MATLAB files. Each recording is seen by cameras all round, at any height and distance, in clothes of any
/// thickness, cut and segmented as recordings are.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear activity train samples.toml --out model.fnm --mode ordered\n\
                  \x20        farnear activity train --motion walk=02_01.bvh anna:'sit down'=sit.c3d --out model.fnm")
)]
#[serde(default)]
pub struct TrainRequest {
    /// The samples, TOML.
    pub samples: Option<PathBuf>,
    /// Motion files to learn from: FILE that names its activity (UTKinect, Florence, NTU), or with the activity and, where it
    /// is not the file's name, the person before it.
    #[cfg_attr(feature = "clap", arg(long, value_name = "[[SUBJECT:]ACTIVITY=]FILE", num_args = 1..))]
    #[serde_as(as = "Vec<DisplayFromStr>")]
    pub motion: Vec<MotionFile>,
    /// What makes bodies of the points: a built-in template's name or a TOML file [default: the built-in one that fits best].
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME|FILE"))]
    pub template: Option<String>,
    /// Axis of the motion files that points up: x, y, z, -x, -y or -z [default: as they state or from the body].
    #[cfg_attr(feature = "clap", arg(long, value_name = "AXIS", allow_hyphen_values = true))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub up: Option<Up>,
    /// Their unit of length: mm, cm, m, in, cmu or a number of millimetres [default: as they say or suggest].
    #[cfg_attr(feature = "clap", arg(long, value_name = "UNIT"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub units: Option<Unit>,
    /// Width and height of the picture, such as 9:16 or 1080x1920, for keypoints with coordinates from 0 to 1 [default: as the file
    /// states, or 16:9].
    #[cfg_attr(feature = "clap", arg(long, value_name = "WIDTH:HEIGHT"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub aspect: Option<Aspect>,
    /// Cameras that see every recording, 1 to 500.
    #[cfg_attr(feature = "clap", arg(long, value_name = "COUNT", default_value_t = Self::default().cameras))]
    pub cameras: usize,
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub method: MethodOptions,
    /// Cut clips into windows of this many frames first, at least 5: for un-segmented recordings.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FRAMES"))]
    pub window: Option<usize>,
    /// Use every view as a separate clip, so that the model recognises from any single view.
    #[cfg_attr(feature = "clap", arg(long))]
    pub any_view: bool,
    /// The model to write. An existing file is replaced only if it is a model.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

impl Default for TrainRequest {
    fn default() -> Self {
        Self {
            samples: None,
            motion: Vec::new(),
            template: None,
            up: None,
            units: None,
            aspect: None,
            cameras: 24,
            method: MethodOptions::default(),
            window: None,
            any_view: false,
            out: PathBuf::new(),
        }
    }
}

impl Request for TrainRequest {
    const NAME: &'static str = "activity train";
    const REQUIRED: &'static [&'static str] = &["out"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("samples", PathKind::Input),
        ("motion", PathKind::NamedInput),
        ("template", PathKind::InputOrName),
        ("out", PathKind::OutputFile),
    ];
    type Figures = TrainingFigures;

    fn check(&self) -> Result<()> {
        if self.samples.is_none() && self.motion.is_empty() {
            let expected = "a file of samples, --motion with recordings, or both";
            return Err(WorkflowError::parameter("what to learn from", "is missing", expected));
        }
        let about_motion = [
            ("template", self.template.clone()),
            ("up", self.up.map(|up| up.to_string())),
            ("units", self.units.map(|unit| unit.to_string())),
            ("aspect", self.aspect.map(|aspect| aspect.to_string())),
        ];
        if let Some((name, value)) = about_motion.into_iter().find_map(|(name, value)| Some((name, value?)))
            && self.motion.is_empty()
        {
            return Err(WorkflowError::parameter(name, value, "it is about --motion, which is missing"));
        }
        within("cameras", self.cameras, &(1..=500), "")?;
        if let Some(window) = self.window {
            at_least("window", window, WINDOW_MIN, "frames")?;
        }
        self.method.method().map(|_| ())
    }

    fn run(&self, context: &Context<'_>) -> Result<TrainingFigures> {
        train(self, context)
    }

    /// The masks too.
    fn inputs(&self) -> Vec<PathBuf> {
        let masks = self.samples.iter().flat_map(|file| Samples::folders(file).unwrap_or_default());
        crate::request::inputs(self).into_iter().chain(masks).collect()
    }
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

fn train(request: &TrainRequest, context: &Context<'_>) -> Result<TrainingFigures> {
    request.check()?;
    result_folder::check_model(&request.out)?;
    let method = request.method.method()?;
    method.announce(context);
    let start = Instant::now();
    let learned = Learned::read(request, context)?;
    let Learned { performances, frames, empty_frames, full_frames, what } = learned;
    let windows = |clip: Clip| match request.window {
        Some(length) => clip.windows(length),
        None => vec![clip],
    };
    let (numbers, clips): (Vec<usize>, Vec<Clip>) = performances
        .into_iter()
        .enumerate()
        .flat_map(|(number, clips)| clips.into_iter().flat_map(windows).map(move |clip| (number, clip)))
        .unzip();
    doubts::warn(clips.iter(), context);
    let few = too_few_performances(&clips, &numbers);
    few.iter().for_each(|warning| context.progress.warn(warning));
    let alone = of_one_subject(&clips);
    if !alone.is_empty() {
        context.progress.warn(&format!(
            "{}: one subject each, so cross-validation does not test them, and they give no limit for unknown; give clips of \
             one person the same subject, or add clips of a second person",
            alone.join(", ")
        ));
    }
    let experiment = method.experiment(full_frames)?;
    let watch = training_progress::Training::new(context);
    let trained = Recogniser::train_performances(&clips, &numbers, &experiment, SCALING, &watch);
    let (model, inner_accuracy) = training_progress::outcome(trained, context, "training").about(|| what)?;
    if let Some(warning) = without_limits(&model).filter(|_| few.is_none()) {
        context.progress.warn(&warning);
    }
    staging::write_file(&request.out, &model.to_bytes()?)?;
    context.info(&format!("wrote {}", request.out.display()));
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
        mode: method.name(),
        layout: layout(&model),
        pattern: pattern(&model),
        gamma,
        condition_number: condition_number.map(|value| rounded(value, 0)),
        inner_accuracy: inner_accuracy.map(|value| rounded(value, 4)),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

/// Activities of one subject, where there are several subjects.
fn of_one_subject(clips: &[Clip]) -> Vec<String> {
    let several = names(clips.iter().map(|clip| &clip.subject)).len() > 1;
    if several { doubts::untaught(clips, clips) } else { Vec::new() }
}

/// Why clips of a single subject give no limit for unknown; `numbers` are those of their performances.
fn too_few_performances(clips: &[Clip], numbers: &[usize]) -> Option<String> {
    let fewest = Limits::fewest(Limits::FALSE_ALARMS);
    let found = numbers.chunk_by(|a, b| a == b).count();
    let single = names(clips.iter().map(|clip| &clip.subject)).len() == 1;
    (single && found < fewest).then(|| {
        format!(
            "a single subject needs {fewest} performances for a limit of unknown, found {found} (views and windows of one \
             count once): nothing is called unknown; add performances, or clips of a second person"
        )
    })
}

/// Why a model calls nothing unknown.
fn without_limits(model: &Recogniser) -> Option<String> {
    let limits = model.second.as_ref().map_or(&model.limits, |second| &second.limits);
    limits.distances.iter().all(|limit| limit.is_infinite()).then(|| {
        format!(
            "a limit of unknown needs {} clips of activities that another subject (or, of a single one, another performance) shows \
             too: nothing is called unknown; add clips",
            Limits::fewest(Limits::FALSE_ALARMS)
        )
    })
}

struct Learned {
    /// Clips of each performance: its views, or one clip of all views.
    performances: Vec<Vec<Clip>>,
    frames: usize,
    empty_frames: usize,
    full_frames: bool,
    what: String,
}

impl Learned {
    fn read(request: &TrainRequest, context: &Context<'_>) -> Result<Self> {
        let mut learned = Self {
            performances: Vec::new(),
            frames: 0,
            empty_frames: 0,
            full_frames: true,
            what: "motion files".into(),
        };
        if let Some(path) = &request.samples {
            let samples = Samples::read(path, context)?;
            learned.frames = samples.frames;
            learned.empty_frames = samples.empty_frames;
            learned.full_frames = samples.full_frames;
            learned.what = path.display().to_string();
            let apart = request.any_view || !request.motion.is_empty();
            learned.performances = if apart {
                samples.split_by_performance()
            } else {
                samples.fused()?.into_iter().map(|clip| vec![clip]).collect()
            };
        }
        if !request.motion.is_empty() {
            let mut found = motion::performances(request, context)?;
            let views = || found.iter().flatten().flat_map(|clip| &clip.views);
            learned.frames += views().map(Track::frames).sum::<usize>();
            if !learned.full_frames {
                let views = found.iter_mut().flatten().flat_map(|clip| &mut clip.views);
                views.for_each(|view| view.boxes = None);
            }
            learned.performances.extend(found);
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

#[cfg(test)]
mod tests {
    use farnear_files::masks;
    use farnear_recognition::model::RecogniserSettings;
    use farnear_recognition::space::SpaceSettings;
    use farnear_silhouettes::mask::Mask;

    use super::*;

    #[test]
    fn views_of_one_clip_are_one_performance_and_few_give_no_limit() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut text = String::new();
        for view in 1..=2 {
            let name = format!("view{view}");
            std::fs::create_dir(folder.path().join(&name)).expect("a folder");
            let mask = Mask::from_shape_fn((40, 30), |(row, column)| {
                (10..35).contains(&row) && (10..15 + 2 * view).contains(&column)
            });
            let file = folder.path().join(&name).join("a.png");
            std::fs::write(file, masks::png(&mask).expect("a picture")).expect("written");
            let sample = "subject = \"ben\"\nactivity = \"walk\"\n";
            text += &format!("[[sample]]\nmasks = \"{name}\"\n{sample}view = {view}\n");
        }
        let samples = folder.path().join("samples.toml");
        std::fs::write(&samples, text).expect("written");
        let request = TrainRequest { samples: Some(samples), any_view: true, ..TrainRequest::default() };
        let learned = Learned::read(&request, &Context::unattended()).expect("samples");
        assert_eq!(learned.performances.iter().map(Vec::len).collect::<Vec<_>>(), [2]);

        let mut clips = learned.performances.concat();
        let warning = too_few_performances(&clips, &[0, 0]).expect("one subject");
        assert!(warning.contains("19 performances") && warning.contains("found 1 "), "{warning}");
        clips[1].subject = "ann".into();
        assert_eq!(too_few_performances(&clips, &[0, 1]), None);

        // Two people, but two clips.
        clips[1].activity = "dig".into();
        let space = SpaceSettings {
            dimensions: 1,
            pattern: PatternKind::Codebook(2),
            residuals: 0,
            ..SpaceSettings::default()
        };
        let settings = RecogniserSettings { space, ..RecogniserSettings::default() };
        let mut model = Recogniser::train(&clips, &settings).expect("trained");
        let warning = without_limits(&model).expect("two clips");
        assert!(warning.contains("19 clips"), "{warning}");
        model.limits.distances.fill(1.0);
        assert_eq!(without_limits(&model), None);
    }
}
