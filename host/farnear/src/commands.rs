//! Commands that need more than their request, and lists of those that run by [`Run`].

pub mod activity;
pub mod batch;
pub mod camera;
pub mod completions;
pub mod doctor;
pub mod man;
pub mod render;
pub mod rig;
pub mod serve;

use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::{
    calibrate::{
        correction::CalibrateCorrectionRequest, psf::CalibratePsfRequest, stack::CalibrateStackRequest,
    },
    camera_frames::CalibrateCameraRequest,
    measure::{MeasureDifferenceRequest, MeasurePlaneRequest, MeasureProfileRequest, MeasureRegionRequest},
    shadow::{removal::ShadowRemoveRequest, score::ShadowScoreRequest},
    silhouettes::{
        markers::MarkersRequest, passages::PassagesRequest, skeletons::SkeletonsRequest,
        synthetic::SyntheticRequest, video::SilhouettesVideoRequest,
    },
};

use crate::run::Run;

macro_rules! tasks {
    ($name:ident { $($variant:ident($task:ty),)* }) => {
        #[derive(Subcommand)]
        pub enum $name {
            $($variant($task),)*
        }

        impl $name {
            pub fn run(self) -> Result<()> {
                match self {
                    $(Self::$variant(task) => task.run(),)*
                }
            }
        }
    };
}

tasks!(Calibrate {
    Psf(Run<CalibratePsfRequest>),
    Correction(Run<CalibrateCorrectionRequest>),
    Stack(Run<CalibrateStackRequest>),
    Camera(Run<CalibrateCameraRequest>),
});

tasks!(Measure {
    Region(Run<MeasureRegionRequest>),
    Plane(Run<MeasurePlaneRequest>),
    Profile(Run<MeasureProfileRequest>),
    Difference(Run<MeasureDifferenceRequest>),
});

tasks!(Shadow {
    Remove(Run<ShadowRemoveRequest>),
    Score(Run<ShadowScoreRequest>),
});

tasks!(Silhouettes {
    Skeletons(Run<SkeletonsRequest>),
    Synthetic(Run<SyntheticRequest>),
    Markers(Box<Run<MarkersRequest>>),
    Video(Run<SilhouettesVideoRequest>),
    Passages(Run<PassagesRequest>),
});
