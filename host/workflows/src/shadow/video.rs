//! Removes the shadow of a person in the sun from a video.

use std::{fs, path::PathBuf};

use farnear_files::{
    masks::{Named, Sequence},
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
    let mut frames = Video::open(&settings.video)?;
    let (first, rate_hz) = (frames.next().ok_or_else(none)??, frames.rate_hz());
    drop(frames);
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
    let paths = ShadowRemoveRequest {
        masks: with.clone(),
        camera: file,
        out: without,
        ..ShadowRemoveRequest::default()
    };
    let removal = removal::remove_from_masks(&in_the_sun(paths, settings, rate_hz), context)?;
    Ok(VideoShadowFigures { silhouettes: made.silhouettes, samples: samples(&with)?, removal })
}

/// The sun moves if the video states its rate.
fn in_the_sun(
    paths: ShadowRemoveRequest,
    settings: &VideoShadowSettings,
    rate_hz: Option<f64>,
) -> ShadowRemoveRequest {
    let (lat, lon) = (Some(settings.lat), Some(settings.lon));
    ShadowRemoveRequest { lat, lon, time: Some(settings.time.clone()), rate_hz, ..paths }
}

fn samples(folder: &std::path::Path) -> Result<Vec<String>> {
    let mut seen = Vec::new();
    for named in Sequence::open(folder)?.named() {
        let Named { name, mask } = named?;
        if mask.iter().any(|person| *person) {
            seen.push(name);
        }
    }
    let step = (seen.len() / SAMPLES).max(1);
    Ok(seen.into_iter().step_by(step).take(SAMPLES).map(|name| format!("{name}.png")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Request;

    #[test]
    fn the_sun_moves_at_the_rate_of_the_video() {
        let folder = tempfile::tempdir().unwrap();
        let video = folder.path().join("walk.y4m");
        fs::write(&video, b"YUV4MPEG2 W2 H2 F25:2 Cmono\nFRAME\n\x10\x10\x10\x10").unwrap();
        let rate_hz = Video::open(&video).unwrap().rate_hz();
        let camera = "[camera]\nheight_m = 1.5\nazimuth_deg = 0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";
        let settings = VideoShadowSettings {
            video,
            camera: CameraFile::parse(camera).unwrap(),
            lat: 52.38,
            lon: -1.56,
            time: "2014-06-23T12:00:00Z".into(),
            out: folder.path().join("out"),
        };
        let request = in_the_sun(ShadowRemoveRequest::default(), &settings, rate_hz);
        assert_eq!((request.rate_hz, request.time.as_deref()), (Some(12.5), Some("2014-06-23T12:00:00Z")));
        assert!(request.check().is_ok());
    }
}
