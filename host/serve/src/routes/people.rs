//! Activities and shadows of people.

use std::{fs, path::PathBuf, sync::Arc};

use axum::{
    Json,
    body::Body as AxumBody,
    extract::{Path, State},
    http::header,
    response::{IntoResponse, Response},
};
use farnear_shadow::{CameraFile, camera};
use farnear_workflows::{
    Context, WorkflowError,
    activity::{recognition::Model, streaming},
    request::Request,
    rig::{RigAddress, live::LiveSettings},
    sessions,
    shadow::video::{self, VideoShadowSettings},
    sun::{PlaceAndTime, SunPositionRequest},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Body, Shared, aside};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    job_queue::Task,
    options::Options,
    picture_message::person,
    routes::rig::{begin, begin_computing, connected, figures},
    transfer::{self, file_body, is_regular, regular_file, session_folder},
    upload_quota::Upload,
    view::{Begun, DONE, Done},
};

const FOLDER: &str = "people";
const VIDEO_MAX_BYTES: u64 = 256 << 20;
const USUAL_MODEL: &str = "everyday";

/// Source of the recognition.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecogniseRequest {
    /// An uploaded video; without it the rig's camera, until it is stopped.
    #[serde(default)]
    pub video: Option<String>,
}

/// How a camera stands.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Standing {
    /// Lens above the ground.
    pub height_m: f64,
    /// Viewing direction, anticlockwise from north, degrees.
    pub azimuth_deg: f64,
    /// Viewing direction below the horizontal, degrees.
    pub pitch_deg: f64,
    /// Focal length, mm.
    pub focal_length_mm: f64,
    /// Distance of neighbouring pixels.
    pub pixel_um: f64,
}

/// A video of a person with a shadow.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShadowRequest {
    /// A video that was sent.
    pub video: String,
    /// Place and time of a recording.
    pub sun: PlaceAndTime,
    /// How the camera stood.
    pub camera: Standing,
}

/// Models and tools that are available.
#[derive(Serialize, JsonSchema)]
pub struct People {
    /// Names of the videos that were sent.
    pub videos: Vec<String>,
    /// Activities that are known.
    pub activities: Vec<String>,
}

/// Where the sun stands and what shadow it throws.
#[derive(Serialize, JsonSchema)]
pub struct Shadow {
    /// As `farnear sun --json` prints it.
    pub figures: Value,
    /// Length of the shadow of a person 1 m tall; absent while the sun is below the horizon.
    pub length_per_height: Option<f64>,
    /// Where it falls, clockwise from north, degrees.
    pub direction_deg: f64,
}

/// That shadow is being taken off.
#[derive(Serialize, JsonSchema)]
pub struct Removing {
    /// The job's number.
    pub job: u64,
    /// Name of the result.
    pub shadow: String,
}

pub fn routes(api: Api) -> Api {
    api.get::<People, _, _>("/api/people", "Videos that were sent, activities that are known.", people)
        .put_bytes::<Done, _, _>("/api/people/videos/{video}", "Uploads a video.", receive)
        .post::<RecogniseRequest, Begun, _, _>(
            "/api/people/recognise",
            For::Control,
            "Recognises a person's activity; the streaming answer comes by the socket.",
            recognise,
        )
        .post::<Options<SunPositionRequest>, Shadow, _, _>(
            "/api/people/sun",
            For::All,
            "Where the sun stands and what shadow it throws; nothing is changed.",
            sunlight,
        )
        .post::<ShadowRequest, Removing, _, _>(
            "/api/people/shadow",
            For::Client,
            "Makes silhouettes of a video and takes the shadow off them.",
            shadow,
        )
        .get_bytes("/api/people/shadows/{shadow}/{masks}/{file}", "A mask.", "image/png", mask)
}

fn folder(app: &App) -> Result<PathBuf, Failure> {
    session_folder(&app.session, FOLDER)
}

fn video_of(app: &App, name: &str) -> Result<PathBuf, Failure> {
    let path = sessions::entry_of(&folder(app)?, name, "video")?;
    match is_regular(&path) {
        true => Ok(path),
        false => Err(Failure::missing(&format!("video {name}"))),
    }
}

async fn people(State(app): Shared) -> Result<Json<People>, Failure> {
    aside(move || {
        let entries = fs::read_dir(folder(&app)?).into_iter().flatten().flatten();
        let files = entries.filter(|entry| is_regular(&entry.path()));
        let names = files.map(|entry| entry.file_name().to_string_lossy().into_owned());
        // Unfinished uploads begin with a dot.
        let mut videos: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
        videos.sort();
        let activities = Model::read(USUAL_MODEL.as_ref())?.activities().to_vec();
        Ok(Json(People { videos, activities }))
    })
    .await
}

async fn receive(
    State(app): Shared,
    Path(name): Path<String>,
    body: AxumBody,
) -> Result<Json<Done>, Failure> {
    let within = folder(&app)?;
    let path = sessions::entry_of(&within, &name, "video")?;
    let (limits, quota) = (app.limits, Arc::clone(&app.uploads));
    let upload = aside(move || {
        fs::create_dir_all(&within)
            .map_err(|source| WorkflowError::Folder { folder: within.clone(), source })?;
        Ok(Upload::begin(quota, path, limits.upload_quota_bytes, VIDEO_MAX_BYTES))
    })
    .await?;
    transfer::receive(body, upload, limits.body_timeout).await?;
    Ok(Json(DONE))
}

async fn recognise(
    State(app): Shared,
    Body(RecogniseRequest { video }): Body<RecogniseRequest>,
) -> Result<Json<Begun>, Failure> {
    let Some(name) = video else {
        let settings = LiveSettings { rig: RigAddress::Open(connected(&app)?), camera: app.camera() };
        let work = move |app: &App, context: &Context<'_>| {
            let model = Model::read(USUAL_MODEL.as_ref())?;
            streaming::camera(&settings, &model, context, |moment| {
                app.pictures.send_replace(person(moment));
                Ok(())
            })?;
            Ok(())
        };
        return begin(&app, Task::new("recognise", "Recognise what the camera sees", work));
    };
    let path = video_of(&app, &name)?;
    let work = move |app: &App, context: &Context<'_>| {
        let model = Model::read(USUAL_MODEL.as_ref())?;
        streaming::video(&path, &model, context, |moment| {
            app.pictures.send_replace(person(moment));
            Ok(())
        })
    };
    begin_computing(&app, Task::new("recognise", format!("Recognise {name}"), work))
}

async fn sunlight(Body(Options(sun)): Body<Options<SunPositionRequest>>) -> Result<Json<Shadow>, Failure> {
    let found = sun.run(&Context::unattended())?;
    let up = found.elevation_deg > 0.0;
    Ok(Json(Shadow {
        length_per_height: up.then(|| 1.0 / found.elevation_deg.to_radians().tan()),
        direction_deg: (found.azimuth_deg + 180.0) % 360.0,
        figures: figures(found)?,
    }))
}

async fn shadow(State(app): Shared, Body(request): Body<ShadowRequest>) -> Result<Json<Removing>, Failure> {
    let video = video_of(&app, &request.video)?;
    request.sun.moment()?;
    let out = sessions::free_names(&folder(&app)?, "shadow", 1)?.remove(0);
    let name = out.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let Standing { height_m, azimuth_deg, pitch_deg, focal_length_mm, pixel_um } = request.camera;
    let camera = camera::Camera {
        height_m,
        azimuth_deg,
        pitch_deg,
        focal_length_mm,
        pixel_um,
        width_px: 0,
        height_px: 0,
        principal_point_px: None,
    };
    let settings = VideoShadowSettings {
        video,
        camera: CameraFile {
            camera,
            subject: camera::SubjectPrior::default(),
            standard_deviations: camera::StandardDeviations::default(),
        },
        lat: request.sun.lat,
        lon: request.sun.lon,
        time: request.sun.time,
        out,
    };
    let masks = name.clone();
    let work = move |_: &App, context: &Context<'_>| {
        let mut found = figures(video::remove_from_video(&settings, context)?)?;
        found["shadow"] = masks.into();
        Ok(found)
    };
    let task = Task::new("shadow", format!("Shadow of {}", request.video), work);
    let Json(Begun { job }) = begin_computing(&app, task)?;
    Ok(Json(Removing { job, shadow: name }))
}

async fn mask(
    State(app): Shared,
    Path((shadow, masks, file)): Path<(String, String, String)>,
) -> Result<Response, Failure> {
    let result = sessions::entry_of(&folder(&app)?, &shadow, "shadow")?;
    let folder = sessions::entry_of(&result, &masks, "masks")?;
    let path = sessions::entry_of(&folder, &file, "mask")?;
    if path.extension().is_none_or(|ending| ending != "png") {
        return Err(Failure::bad_request(format!("file {file}: expected a mask, NAME.png")));
    }
    let missing = move || Failure::missing(&format!("mask {file}"));
    let opened = aside(move || match result.is_symlink() || folder.is_symlink() {
        true => Err(missing()),
        false => regular_file(&path).map_err(|_| missing()),
    })
    .await?;
    Ok(([(header::CONTENT_TYPE, "image/png")], file_body(opened)).into_response())
}
