//! Silhouettes of public joint sets: capsules around the joints, drawn in views from all sides.

use std::{fs, path::PathBuf};

use farnear_silhouettes::readers::skeletons::{
    FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, Layout, UTKINECT_ACTIVITIES, dress, read_cells,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{
    SilhouettesError,
    performances::{self, Drawing, Performance, PerformancesFigures},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
};

/// Silhouettes of a data set that has body joints only: joints are dressed with capsules and drawn from views all round.
///
/// Writes a folder of masks for every performance and view, and `samples.toml` for `farnear activity`.
#[serde_as]
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear silhouettes skeletons UTKinect_Skeletons.mat --set utkinect --out people/"
    )
)]
#[serde(default)]
pub struct SkeletonsRequest {
    /// The joints, a MATLAB 5 file of cells.
    pub file: PathBuf,
    /// Data set: utkinect (UTKinect-Action3D, 20 joints of a Kinect) or florence (Florence 3D Actions, 15 joints).
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "DisplayFromStr")]
    pub set: SkeletonSet,
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub drawing: Drawing,
}

impl Request for SkeletonsRequest {
    const NAME: &'static str = "silhouettes skeletons";
    const REQUIRED: &'static [&'static str] = &["file", "set", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("file", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = PerformancesFigures;

    fn check(&self) -> Result<()> {
        self.drawing.check()
    }

    fn run(&self, context: &Context<'_>) -> Result<PerformancesFigures> {
        draw(self, context)
    }
}

#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub enum SkeletonSet {
    /// 20 joints of a Kinect.
    #[default]
    UtKinect,
    /// 15 joints of a Kinect.
    Florence,
}

farnear_silhouettes::named!(SkeletonSet, "data set", "utkinect" => UtKinect, "florence" => Florence);

impl SkeletonSet {
    fn known(self) -> (Layout, &'static [&'static str]) {
        match self {
            Self::UtKinect => (KINECT_20, &UTKINECT_ACTIVITIES),
            Self::Florence => (FLORENCE_15, &FLORENCE_ACTIVITIES),
        }
    }
}

pub fn draw(settings: &SkeletonsRequest, context: &Context<'_>) -> Result<PerformancesFigures> {
    settings.drawing.check()?;
    let path = &settings.file;
    let bytes = fs::read(path).map_err(WorkflowError::read("the skeletons", path))?;
    let (layout, activities) = settings.set.known();
    let clips = read_cells(&bytes, &layout)
        .map_err(|source| SilhouettesError::Skeletons { path: path.clone(), source })?;
    let performances = clips.iter().map(|clip| Performance {
        subject: format!("s{:02}", clip.subject + 1),
        activity: activities
            .get(clip.activity)
            .map_or_else(|| clip.activity.to_string(), ToString::to_string),
        bodies: clip.frames.iter().map(|joints| dress(joints, &layout)).collect(),
    });
    performances::write(&performances.collect::<Vec<_>>(), 0.0, &settings.drawing, context)
}
