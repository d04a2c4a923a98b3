//! A series of pairs, each in its own folder, to measure noise over time and changes.

use std::path::PathBuf;

use farnear_capture::record::{begin_folder, finish_folder};
use serde::Serialize;

use super::{
    RigAddress,
    camera::CameraSettings,
    pair::{PairFigures, take},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    optics::GivenOptics,
};

const MOST: usize = 1000;

#[derive(Clone, Debug)]
pub struct SeriesSettings {
    pub rig: RigAddress,
    pub camera: CameraSettings,
    pub optics: PathBuf,
    pub out: Vec<PathBuf>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SeriesFigures {
    pub pairs: Vec<PairFigures>,
}

/// Captures the pairs. A cancelled series keeps its complete pairs.
pub fn capture(settings: &SeriesSettings, context: &Context<'_>) -> Result<SeriesFigures> {
    let count = settings.out.len();
    if count == 0 || count > MOST {
        return Err(WorkflowError::parameter("pairs", count, format!("expected 1 to {MOST}")));
    }
    let optics = GivenOptics::read(&settings.optics)?;
    let mut rig = settings.camera.connect(&settings.rig, Some(&optics), context)?;
    let mut pairs = Vec::new();
    for out in &settings.out {
        context.cancel.check("capturing a series")?;
        let folder = begin_folder(out)?;
        let (pair, record) = take(&mut rig, &optics, &settings.camera, context)?;
        finish_folder(folder, &pair, &record)?;
        pairs.push(PairFigures::from(&pair));
        context.progress.advance("pairs", pairs.len(), Some(count));
    }
    Ok(SeriesFigures { pairs })
}
