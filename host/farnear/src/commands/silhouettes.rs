use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::silhouettes::{
    markers::MarkersRequest, passages::PassagesRequest, skeletons::SkeletonsRequest,
    synthetic::SyntheticRequest, video::SilhouettesVideoRequest,
};

use crate::run::Run;

#[derive(Subcommand)]
pub enum Source {
    Skeletons(Run<SkeletonsRequest>),
    Synthetic(Run<SyntheticRequest>),
    Markers(Box<Run<MarkersRequest>>),
    Video(Run<SilhouettesVideoRequest>),
    Passages(Run<PassagesRequest>),
}

pub fn run(source: Source) -> Result<()> {
    match source {
        Source::Skeletons(task) => task.run(),
        Source::Synthetic(task) => task.run(),
        Source::Markers(task) => task.run(),
        Source::Video(task) => task.run(),
        Source::Passages(task) => task.run(),
    }
}
