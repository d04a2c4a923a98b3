//! `farnear silhouettes skeletons` and `synthetic`: performances of bodies made of capsules, as masks and samples to train on.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use farnear_workflows::silhouettes::{
    performances::Drawing,
    skeletons::{self, SkeletonSet, SkeletonsSettings},
    synthetic::{self, SyntheticSettings},
};

use crate::{report, terminal};

/// Silhouettes of a data set that has body joints only: joints are dressed with capsules and drawn from views all round.
///
/// Writes a folder of masks for every performance and view, and `samples.toml` for `farnear activity`.
#[derive(Args)]
#[command(
    after_help = "Example: farnear silhouettes skeletons UTKinect_Skeletons.mat --set utkinect --out people/"
)]
pub struct Skeletons {
    /// The joints, a MATLAB 5 file of cells.
    file: PathBuf,
    /// Which data set it is.
    #[arg(long)]
    set: Set,
    #[command(flatten)]
    drawing: DrawingArguments,
}

/// Silhouettes of seeded synthetic people at the ten activities of Li 2014, table 7.1.
///
/// Writes a folder of masks for every performance and view, and `samples.toml` for `farnear activity`: something to try everything with.
#[derive(Args)]
#[command(after_help = "Example: farnear silhouettes synthetic --subjects 6 --out people/")]
pub struct Synthetic {
    /// People, each with a build and habits of their own.
    #[arg(long, default_value_t = 6)]
    subjects: usize,
    /// Only these activities: walk, drop, crouch, peer, mobile, place, bag, shoot, gun, dig.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    activities: Vec<String>,
    /// Frames per second.
    #[arg(long, default_value_t = 8.0)]
    rate_hz: f64,
    #[command(flatten)]
    drawing: DrawingArguments,
}

/// How bodies are drawn and where to.
#[derive(Args)]
struct DrawingArguments {
    /// Views at equal steps round the subject.
    #[arg(long, default_value_t = 4)]
    views: usize,
    /// Millimetres per pixel.
    #[arg(long, default_value_t = 10.0)]
    mm_per_px: f64,
    /// Folder for masks and samples.toml; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Set {
    /// UTKinect-Action3D: 20 joints of a Kinect.
    Utkinect,
    /// Florence 3D Actions: 15 joints.
    Florence,
}

impl DrawingArguments {
    fn drawing(self) -> Drawing {
        Drawing { views: self.views, mm_per_px: self.mm_per_px, out: self.out }
    }
}

/// Runs `skeletons`.
pub fn skeletons(arguments: Skeletons) -> Result<()> {
    let json = arguments.drawing.json;
    let set = match arguments.set {
        Set::Utkinect => SkeletonSet::UtKinect,
        Set::Florence => SkeletonSet::Florence,
    };
    let settings = SkeletonsSettings { file: arguments.file, set, drawing: arguments.drawing.drawing() };
    report::print(&skeletons::draw(&settings, &terminal::counting(json)?)?, json)
}

/// Runs `synthetic`.
pub fn synthetic(arguments: Synthetic) -> Result<()> {
    let json = arguments.drawing.json;
    let settings = SyntheticSettings {
        subjects: arguments.subjects,
        activities: arguments.activities,
        rate_hz: arguments.rate_hz,
        drawing: arguments.drawing.drawing(),
    };
    report::print(&synthetic::draw(&settings, &terminal::counting(json)?)?, json)
}
