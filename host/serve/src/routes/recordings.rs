use std::{fs, path::PathBuf};

use axum::{
    Json,
    extract::State,
    http::{HeaderMap, StatusCode},
};
use farnear_workflows::{Context, WorkflowError, optics::GivenOptics, rig::recording::Recorder, sessions};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, Shared, aside, require_client, require_control};
use crate::{
    api::{Api, For},
    app::{App, lock},
    failure::Failure,
    job_queue::Task,
    live,
    routes::rig::figures,
    view::{Begun, DONE, Done, LiveMode},
};

const FOLDER: &str = "recordings";
const ENDING: &str = ".pairs";

/// Whether live depth is recorded.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordRequest {
    /// From now on, or no more.
    pub on: bool,
}

/// Recording to play, with options.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlayRequest {
    /// Name of the recording.
    pub recording: String,
    /// As fast as depth is computed, instead of as it was recorded.
    #[serde(default)]
    pub fast: bool,
}

/// A recording of live depth.
#[derive(Serialize, JsonSchema)]
pub struct OneRecording {
    /// Name of its file.
    pub name: String,
    /// Size of its file, bytes.
    pub megabytes: f64,
}

/// All recordings of the session.
#[derive(Serialize, JsonSchema)]
pub struct Recordings {
    /// Recordings, sorted by name.
    pub recordings: Vec<OneRecording>,
}

pub fn routes(api: Api) -> Api {
    api.get::<Recordings, _, _>("/api/recordings", "Recordings of live depth.", list)
        .post::<RecordRequest, Done, _, _>(
            "/api/recordings",
            For::Control,
            "Begins to record live depth, or ends it.",
            record,
        )
        .post::<PlayRequest, Begun, _, _>(
            "/api/recordings/play",
            For::Client,
            "Plays a recording: depth is computed again and comes by the socket as live depth.",
            play,
        )
}

fn folder(app: &App) -> PathBuf {
    app.session.join(FOLDER)
}

async fn list(State(app): Shared) -> Result<Json<Recordings>, Failure> {
    aside(move || {
        let entries = fs::read_dir(folder(&app)).into_iter().flatten().flatten();
        let mut recordings: Vec<OneRecording> = entries
            .filter_map(|entry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                let bytes = entry.metadata().ok()?.len();
                let regular = entry.file_type().is_ok_and(|kind| kind.is_file());
                let whole = regular && name.ends_with(ENDING) && !name.starts_with('.');
                whole.then(|| OneRecording { name, megabytes: (bytes as f64 / 1e5).round() / 10.0 })
            })
            .collect();
        recordings.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Json(Recordings { recordings }))
    })
    .await
}

async fn record(
    State(app): Shared,
    headers: HeaderMap,
    Body(RecordRequest { on }): Body<RecordRequest>,
) -> Result<Json<Done>, Failure> {
    require_control(&app, &headers)?;
    if !on {
        app.finish_recording();
        return Ok(Json(DONE));
    }
    if app.live().mode != LiveMode::Depth {
        return Err(Failure::new(StatusCode::CONFLICT, "live depth is off: there is nothing to record")
            .with_hint("Begin live depth first."));
    }
    let mut recorder = lock(&app.recorder);
    if recorder.is_some() {
        return Err(Failure::busy("a recording"));
    }
    let folder = folder(&app);
    let free =
        (1..).map(|number| format!("live-{number:03}{ENDING}")).find(|name| !folder.join(name).exists());
    let name = free.unwrap_or_default();
    *recorder = Some(Recorder::begin(&folder.join(&name), &GivenOptics::read(&app.optics_file())?)?);
    drop(recorder);
    app.change(|state| (state.live.recording, state.live.recording_ended) = (Some(name), None));
    Ok(Json(DONE))
}

async fn play(
    State(app): Shared,
    headers: HeaderMap,
    Body(PlayRequest { recording, fast }): Body<PlayRequest>,
) -> Result<Json<Begun>, Failure> {
    require_client(&app, &headers)?;
    let path = sessions::folder_of(&folder(&app), &recording)?;
    if !path.is_file() {
        return Err(Failure::missing(&format!("recording {recording}")));
    }
    let work = move |app: &App, context: &Context<'_>| -> Result<_, WorkflowError> {
        figures(live::play(app, &path, fast, context)?)
    };
    let task = Task { kind: "play", title: format!("Play {recording}"), work: Box::new(work) };
    let job = app.begin_computing(task).map_err(|title| Failure::busy(&title))?;
    Ok(Json(Begun { job }))
}
