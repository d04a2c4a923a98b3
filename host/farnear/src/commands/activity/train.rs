use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use farnear_silhouettes::readers::recording::{Choices, Unit, Up};
use farnear_workflows::activity::{
    motion::{MotionFile, MotionSettings},
    shipped::{self, SyntheticTraining},
    training::{self, TrainingSettings},
};

use super::method::MethodArguments;
use crate::{report, terminal};

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
///
/// --synthetic makes models of everyday activities from seeded people alone, as those that come with the program were made: networks
/// that recognise from any one view, ordered and order-free, for full frames and for 100x100; --out is a new folder then.
#[derive(Args)]
#[command(after_help = "Example: farnear activity train samples.toml --out model.fnm --mode ordered\n\
                  \x20        farnear activity train --motion walk=02_01.bvh anna:'sit down'=sit.c3d --out model.fnm\n\
                  \x20        farnear activity train --synthetic everyday --out models/")]
pub struct Arguments {
    /// The samples, TOML.
    #[arg(required_unless_present_any = ["synthetic", "motion"])]
    samples: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionArguments,
    /// Learn from synthetic people instead of samples.
    #[arg(long, value_name = "WHICH", conflicts_with_all = ["samples", "motion", "window", "any_view", "mode", "epl", "classifier", "no_search", "features"])]
    synthetic: Option<Synthetic>,
    /// Synthetic people to learn from.
    #[arg(long, value_name = "COUNT", default_value_t = shipped::PEOPLE, requires = "synthetic")]
    people: usize,
    /// Passes of the learning over all synthetic people.
    #[arg(long, value_name = "COUNT", default_value_t = shipped::PASSES, requires = "synthetic")]
    passes: usize,
    /// The model to write, or with --synthetic the new folder for several.
    #[arg(long, value_name = "FILE|DIR")]
    out: PathBuf,
    #[command(flatten)]
    method: MethodArguments,
    /// Cut clips into windows of this many frames first: for un-segmented recordings.
    #[arg(long, value_name = "FRAMES")]
    window: Option<usize>,
    /// Use every view as a separate clip, so that the model recognises from any single view.
    #[arg(long)]
    any_view: bool,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct MotionArguments {
    /// Motion files to learn from: FILE that names its activity (UTKinect, Florence, NTU), or with the activity and, where it
    /// is not the file's name, the person before it.
    #[arg(long, value_name = "[[SUBJECT:]ACTIVITY=]FILE", num_args = 1..)]
    motion: Vec<MotionFile>,
    /// What makes bodies of the points: a built-in template's name or a TOML file [default: the built-in one that fits best].
    #[arg(long, value_name = "NAME|FILE", requires = "motion")]
    template: Option<String>,
    /// Which axis of the motion files points up: x, y or z [default: as they say or suggest].
    #[arg(long, requires = "motion")]
    up: Option<Up>,
    /// Their unit of length: mm, cm, m, in, cmu or a number of millimetres [default: as they say or suggest].
    #[arg(long, value_name = "UNIT", requires = "motion")]
    units: Option<Unit>,
    /// Cameras that see every recording.
    #[arg(long, value_name = "COUNT", default_value_t = 24, requires = "motion")]
    cameras: usize,
}

impl MotionArguments {
    fn settings(self) -> Option<MotionSettings> {
        let choices = Choices { unit: self.units, up: self.up, person: None };
        let settings =
            MotionSettings { files: self.motion, template: self.template, choices, cameras: self.cameras };
        (!settings.files.is_empty()).then_some(settings)
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Synthetic {
    /// Walking, sitting down, waving, drinking, digging and so on (farnear activity models lists them).
    Everyday,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    if let Some(Synthetic::Everyday) = arguments.synthetic {
        let settings =
            SyntheticTraining { people: arguments.people, passes: arguments.passes, out: arguments.out };
        return report::print(&shipped::train(&settings, &terminal::counting(json)?)?, json);
    }
    let settings = TrainingSettings {
        samples: arguments.samples,
        motion: arguments.motion.settings(),
        out: arguments.out,
        method: arguments.method.method(),
        window: arguments.window,
        any_view: arguments.any_view,
    };
    report::print(&training::train(&settings, &terminal::counting(json)?)?, json)
}
