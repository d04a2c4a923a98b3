//! Removes the shadow of a person in the sun from a video.

use std::{fs, path::PathBuf};

use farnear_files::{
    staging,
    video::{Video, VideoError},
};
use farnear_shadow::CameraFile;
use farnear_silhouettes::background;
use serde::Serialize;

use super::removal::{self, RemovalFigures, ShadowRemoveRequest};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    silhouettes::{
        frame_of,
        video::{self, SilhouettesVideoRequest},
    },
};

pub const WITH: &str = "with-shadow";
pub const WITHOUT: &str = "without-shadow";

#[derive(Clone, PartialEq, Debug)]
pub struct VideoShadowSettings {
    pub video: PathBuf,
    /// Pose of the camera; the picture's size is taken from the video.
    pub camera: CameraFile,
    pub lat: f64,
    pub lon: f64,
    /// Time of the video, RFC 3339.
    pub time: String,
    pub out: PathBuf,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct VideoShadowFigures {
    pub silhouettes: usize,
    /// Names of some masks with a person, spread evenly over the video.
    pub samples: Vec<String>,
    #[serde(flatten)]
    pub removal: RemovalFigures,
}

const SAMPLES: usize = 6;

/// Makes both folders of masks. On failure the complete ones remain.
pub fn remove_from_video(
    settings: &VideoShadowSettings,
    context: &Context<'_>,
) -> Result<VideoShadowFigures> {
    let none = || VideoError::NoFrames { path: settings.video.clone() };
    let first = Video::open(&settings.video)?.next().ok_or_else(none)??;
    let (height, width) = frame_of(&first.pixels).size();
    let mut camera = settings.camera.clone();
    (camera.camera.width_px, camera.camera.height_px) = (width, height);
    let text = toml::to_string(&camera)?;
    CameraFile::parse(&text).about(|| "the camera".into())?;
    fs::create_dir_all(&settings.out)
        .map_err(|source| WorkflowError::Folder { folder: settings.out.clone(), source })?;
    let file = settings.out.join("camera.toml");
    staging::write_file(&file, text.as_bytes())?;
    let (with, without) = (settings.out.join(WITH), settings.out.join(WITHOUT));
    let masks = SilhouettesVideoRequest {
        video: settings.video.clone(),
        out: with.clone(),
        learn_first: true,
        learning_frames: 0,
        history_frames: background::Settings::default().history_frames,
        keep_shadow: true,
        ..SilhouettesVideoRequest::default()
    };
    let made = video::extract(&masks, context)?;
    let removal = removal::remove_from_masks(
        &ShadowRemoveRequest {
            masks: with.clone(),
            camera: file,
            lat: Some(settings.lat),
            lon: Some(settings.lon),
            time: Some(settings.time.clone()),
            out: without,
            ..ShadowRemoveRequest::default()
        },
        context,
    )?;
    Ok(VideoShadowFigures { silhouettes: made.silhouettes, samples: samples(&with)?, removal })
}

fn samples(folder: &std::path::Path) -> Result<Vec<String>> {
    let masks = farnear_files::masks::read_all(folder)?.named;
    let seen: Vec<&String> = masks
        .iter()
        .filter(|named| named.mask.iter().any(|person| *person))
        .map(|named| &named.name)
        .collect();
    let step = (seen.len() / SAMPLES).max(1);
    Ok(seen.into_iter().step_by(step).take(SAMPLES).map(|name| format!("{name}.png")).collect())
}
