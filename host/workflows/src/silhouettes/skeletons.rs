//! Silhouettes of a data set that has body joints only: joints are dressed with capsules and drawn from views all round.

use std::{fs, path::PathBuf};

use farnear_silhouettes::readers::skeletons::{
    FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, Layout, UTKINECT_ACTIVITIES, dress, read_cells,
};

use super::{
    SilhouettesError,
    performances::{self, Drawing, Performance, PerformancesFigures},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

#[derive(Clone, PartialEq, Debug)]
pub struct SkeletonsSettings {
    /// The joints, a MATLAB 5 file of cells.
    pub file: PathBuf,
    /// Which data set it is.
    pub set: SkeletonSet,
    /// How bodies are drawn.
    pub drawing: Drawing,
}

/// A public data set of body joints.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SkeletonSet {
    /// UTKinect-Action3D: 20 joints of a Kinect.
    UtKinect,
    /// Florence 3D Actions: 15 joints.
    Florence,
}

impl SkeletonSet {
    fn known(self) -> (Layout, &'static [&'static str]) {
        match self {
            Self::UtKinect => (KINECT_20, &UTKINECT_ACTIVITIES),
            Self::Florence => (FLORENCE_15, &FLORENCE_ACTIVITIES),
        }
    }
}

/// Draws all performances of a set.
pub fn draw(settings: &SkeletonsSettings, context: &Context<'_>) -> Result<PerformancesFigures> {
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
