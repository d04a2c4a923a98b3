//! Recognisers included in the program, and their training.

use std::{path::PathBuf, time::Instant};

use farnear_files::staging::Staging;
use farnear_recognition::clip::Clip;
use farnear_recognition::frames::Mode;
use farnear_recognition::model::Recogniser;
use farnear_recognition::network::training::NetworkSettings;
use farnear_recognition::space::SpaceSettings;
use farnear_recognition::synthetic::everyday;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{samples::SCALING, training_progress};
use crate::{
    context::Context,
    error::Result,
    figures::rounded,
    parameters::within,
    request::{PathKind, Request},
};

#[derive(PartialEq)]
pub struct Shipped {
    pub name: &'static str,
    pub about: &'static str,
    /// Figures of a set opened after the training.
    new_set: NewSet,
    bytes: &'static [u8],
    /// Model file for silhouettes cut out at 100x100, without motion through the picture.
    cut_out: &'static [u8],
}

/// Figures of a set not used for the model; shares from 0 to 1.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct NewSet {
    /// Correct among all activities.
    pub accuracy: f64,
    /// Correct among the activities of the set.
    pub accuracy_among: f64,
    /// Among the activities of the set.
    pub calibration_error: f64,
    /// Known activities called unknown.
    pub unknown_of_known: f64,
    /// Area under the outlier score's ROC curve; 0.5 is chance.
    pub outlier_auroc: f64,
}

/// MSR Action3D (Li et al. 2010), opened after training: 278 clips of 8 known, 231 of 8 unknown activities, four views.
const EVERYDAY_ON_A_NEW_SET: NewSet = NewSet {
    accuracy: 0.33,
    accuracy_among: 0.51,
    calibration_error: 0.24,
    unknown_of_known: 0.18,
    outlier_auroc: 0.58,
};

/// As [`EVERYDAY_ON_A_NEW_SET`].
const ORDER_FREE_ON_A_NEW_SET: NewSet = NewSet {
    accuracy: 0.37,
    accuracy_among: 0.53,
    calibration_error: 0.25,
    unknown_of_known: 0.03,
    outlier_auroc: 0.54,
};

pub const MODELS: &[Shipped] = &[
    Shipped {
        name: "everyday",
        about: "everyday activities from one view or several, from any side; the order of frames counts",
        new_set: EVERYDAY_ON_A_NEW_SET,
        bytes: include_bytes!("../../../recognition/models/everyday.fnm"),
        cut_out: include_bytes!("../../../recognition/models/everyday-cut-out.fnm"),
    },
    Shipped {
        name: "everyday-order-free",
        about: "the same where the order of frames does not count",
        new_set: ORDER_FREE_ON_A_NEW_SET,
        bytes: include_bytes!("../../../recognition/models/everyday-order-free.fnm"),
        cut_out: include_bytes!("../../../recognition/models/everyday-order-free-cut-out.fnm"),
    },
];

/// Names of [`MODELS`], as in "everyday or everyday-order-free".
pub fn names() -> String {
    MODELS.iter().map(|model| model.name).collect::<Vec<_>>().join(" or ")
}

/// The sequence model, which supplies the outlier score for trained models.
pub fn auxiliary_model(full_frames: bool) -> Result<Recogniser> {
    let [full, cut_out] = MODELS[0].recognisers()?;
    Ok(if full_frames { full } else { cut_out })
}

/// Data sheet: training, tests and failures.
pub const SHEET: &str = include_str!("../../../recognition/models/README.md");

impl std::fmt::Debug for Shipped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl Shipped {
    /// Expected accuracy on new data, for the user.
    #[must_use]
    pub fn expectation(&self) -> String {
        let NewSet { accuracy, accuracy_among, unknown_of_known, outlier_auroc, .. } = self.new_set;
        let percent = |share: f64| (100.0 * share).round();
        format!(
            "`{}` on a new set: {} % of answers right ({} % among the set's activities), {} % of known activities called unknown, \
             unknown ones separated with an AUROC of {outlier_auroc} (0.5 is chance)",
            self.name,
            percent(accuracy),
            percent(accuracy_among),
            percent(unknown_of_known)
        )
    }

    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name == name)
    }

    /// Recognisers of full frames and of cut-out silhouettes.
    pub fn recognisers(&self) -> Result<[Recogniser; 2]> {
        Ok([Recogniser::from_bytes(self.bytes)?, Recogniser::from_bytes(self.cut_out)?])
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ModelFigures {
    pub name: &'static str,
    pub about: &'static str,
    pub bytes: usize,
    /// Share of known clips called unknown, on synthetic people as in training.
    pub false_alarms_on_synthetic_people: f64,
    pub on_a_new_set: NewSet,
    pub activities: Vec<String>,
}

pub fn list() -> Result<Vec<ModelFigures>> {
    MODELS
        .iter()
        .map(|model| {
            let [recogniser, _] = model.recognisers()?;
            Ok(ModelFigures {
                name: model.name,
                about: model.about,
                bytes: model.bytes.len() + model.cut_out.len(),
                on_a_new_set: model.new_set,
                false_alarms_on_synthetic_people: rounded(f64::from(recogniser.limits.false_alarms), 4),
                activities: recogniser.activities,
            })
        })
        .collect()
}

/// Trains models of everyday activities on seeded synthetic people alone, as those that come with the program were made.
///
/// The networks recognise from any one view, ordered and order-free, for full frames and for 100x100.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(feature = "clap", command(after_help = "Example: farnear activity train-synthetic --out models/"))]
#[serde(default)]
pub struct TrainSyntheticRequest {
    /// Synthetic people to learn from, each at all activities once, 20 to 5000.
    #[cfg_attr(feature = "clap", arg(long, value_name = "COUNT", default_value_t = Self::default().people))]
    pub people: usize,
    /// Passes of the learning over all synthetic people, 1 to 200.
    #[cfg_attr(feature = "clap", arg(long, value_name = "COUNT", default_value_t = Self::default().passes))]
    pub passes: usize,
    /// New folder for the models.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Default for TrainSyntheticRequest {
    /// As the shipped models.
    fn default() -> Self {
        Self { people: 3000, passes: 6, out: PathBuf::new() }
    }
}

impl Request for TrainSyntheticRequest {
    const NAME: &'static str = "activity train-synthetic";
    const REQUIRED: &'static [&'static str] = &["out"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("out", PathKind::OutputFolder)];
    type Figures = SyntheticTrainingFigures;

    fn check(&self) -> Result<()> {
        within("people", self.people, &(20..=5000), "")?;
        within("passes", self.passes, &(1..=200), "")
    }

    fn run(&self, context: &Context<'_>) -> Result<SyntheticTrainingFigures> {
        train(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SyntheticTrainingFigures {
    pub clips: usize,
    /// Clips of other people for calibration.
    pub calibration_clips: usize,
    pub activities: usize,
    pub seconds: f64,
    pub model: Vec<MadeModel>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MadeModel {
    pub file: String,
    pub accuracy: f64,
    pub bytes: usize,
}

/// First calibration subject, beyond all training subjects.
const CALIBRATING_FROM: usize = 100_000;
/// People drawn between two checks for cancellation.
const PEOPLE_AT_ONCE: usize = 10;
/// File name, mode, and whether silhouettes are cut out.
const FILES: [(&str, Mode, bool); 4] = [
    ("everyday.fnm", Mode::Ordered, false),
    ("everyday-order-free.fnm", Mode::OrderFree, false),
    ("everyday-cut-out.fnm", Mode::Ordered, true),
    ("everyday-order-free-cut-out.fnm", Mode::OrderFree, true),
];
/// Frames before and after a frame in the sequence network's input: together 0.2 s to 1 s.
const REACH: usize = 2;
/// Least share of a clip's frames in a training step without order (with order no gain, see the data sheet).
const KEEP: f32 = 0.6;
/// SD of a whole clip's offset in a training step with order, for calibration, in SDs of each component.
const SHIFT: f32 = 0.2;
/// Networks in a model's ensemble.
const MEMBERS: usize = 2;
/// Principal components of centroid distances and coarse silhouettes.
const DIMENSIONS: usize = 60;
/// Silhouettes for the principal components.
const GALLERY: usize = 4000;

/// The same kind of processor gives identical files.
fn train(settings: &TrainSyntheticRequest, context: &Context<'_>) -> Result<SyntheticTrainingFigures> {
    settings.check()?;
    let start = Instant::now();
    let out = Staging::new_folder(&settings.out)?;
    let mut people = Vec::new();
    for first in (0..settings.people).step_by(PEOPLE_AT_ONCE) {
        context.cancel.check("drawing people")?;
        let count = PEOPLE_AT_ONCE.min(settings.people - first);
        people.extend(everyday::clips(first, count, SCALING));
        context.progress.advance("people drawn", first + count, Some(settings.people));
    }
    let calibrating = (settings.people / 8).clamp(20, 60);
    let mut others = everyday::clips(CALIBRATING_FROM, calibrating, SCALING);
    let mut made = Vec::new();
    for (file, mode, cut_out) in FILES {
        if cut_out {
            let views = people.iter_mut().chain(&mut others).flat_map(|clip| &mut clip.views);
            views.for_each(|view| view.boxes = None);
        }
        context.info(&format!("training {file}"));
        made.push(one(file, mode, &people, &others, settings.passes, &out, context)?);
    }
    out.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(SyntheticTrainingFigures {
        clips: people.len(),
        calibration_clips: others.len(),
        activities: everyday::ACTIVITIES.len(),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
        model: made,
    })
}

fn one(
    file: &str,
    mode: Mode,
    people: &[Clip],
    others: &[Clip],
    passes: usize,
    out: &Staging,
    context: &Context<'_>,
) -> Result<MadeModel> {
    let space = SpaceSettings { mode, dimensions: DIMENSIONS, gallery: GALLERY, ..SpaceSettings::default() };
    let (reach, keep, shift) = if mode == Mode::Ordered { (REACH, 1.0, SHIFT) } else { (0, KEEP, 0.0) };
    let network =
        NetworkSettings { passes, reach, keep, shift, members: MEMBERS, ..NetworkSettings::default() };
    let watch = training_progress::Passes::new(context);
    let trained = Recogniser::train_network(people, others, &space, &network, SCALING, &watch);
    let model = training_progress::outcome(trained, context, "training")?;
    let right = others.iter().filter(|clip| {
        model.recognise(&clip.views).is_ok_and(|answer| answer.best() == Some(&clip.activity))
    });
    let accuracy = rounded(right.count() as f64 / others.len().max(1) as f64, 4);
    let bytes = model.to_bytes()?;
    out.write(file, &bytes)?;
    Ok(MadeModel { file: file.into(), accuracy, bytes: bytes.len() })
}
