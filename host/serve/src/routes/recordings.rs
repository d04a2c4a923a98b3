use std::{fs, path::PathBuf};

use axum::{Json, extract::State, http::StatusCode};
use farnear_workflows::{Context, optics::GivenOptics, rig::recording::Recorder, sessions};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, Shared, aside};
use crate::{
    api::{Api, For},
    app::{App, Running, lock},
    failure::Failure,
    job_queue::Task,
    live,
    routes::rig::begin_computing,
    transfer::{is_regular, session_folder},
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
    /// Size of its file, MB.
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

fn folder(app: &App) -> Result<PathBuf, Failure> {
    session_folder(&app.session, FOLDER)
}

async fn list(State(app): Shared) -> Result<Json<Recordings>, Failure> {
    aside(move || {
        let entries = fs::read_dir(folder(&app)?).into_iter().flatten().flatten();
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
    Body(RecordRequest { on }): Body<RecordRequest>,
) -> Result<Json<Done>, Failure> {
    // Both wait for the disk, also for the pair that is being written.
    aside(move || match on {
        true => begin_recording(&app),
        false => {
            app.finish_recording();
            Ok(())
        }
    })
    .await?;
    Ok(Json(DONE))
}

fn begin_recording(app: &App) -> Result<(), Failure> {
    // Held until the state shows the recording: live depth that ends meanwhile finishes it afterwards.
    let mut recorder = lock(&app.recorder);
    let live = app.live();
    if live.mode != LiveMode::Depth {
        return Err(Failure::new(StatusCode::CONFLICT, "live depth is off: there is nothing to record")
            .with_hint("Begin live depth first."));
    }
    if recorder.is_some() {
        return Err(Failure::busy("a recording"));
    }
    let folder = folder(app)?;
    let free =
        (1..).map(|number| format!("live-{number:03}{ENDING}")).find(|name| !folder.join(name).exists());
    let name = free.unwrap_or_default();
    let begun = Recorder::begin(&folder.join(&name), &GivenOptics::read(&app.optics_file())?)?;
    *recorder = Some(Running { recorder: begun, view: live.cancel });
    app.change(|state| (state.live.recording, state.live.recording_ended) = (Some(name), None));
    Ok(())
}

async fn play(
    State(app): Shared,
    Body(PlayRequest { recording, fast }): Body<PlayRequest>,
) -> Result<Json<Begun>, Failure> {
    let path = sessions::entry_of(&folder(&app)?, &recording, "recording")?;
    if !is_regular(&path) {
        return Err(Failure::missing(&format!("recording {recording}")));
    }
    let work = move |app: &App, context: &Context<'_>| live::play(app, &path, fast, context);
    begin_computing(&app, Task::new("play", format!("Play {recording}"), work))
}

#[cfg(test)]
mod tests {
    use std::{
        future::poll_fn,
        sync::Arc,
        task::Poll,
        thread::{scope, sleep},
        time::Duration,
    };

    use super::*;
    use crate::live::tests::app;

    #[test]
    fn no_recording_begins_while_live_depth_ends() {
        let session = tempfile::tempdir().unwrap();
        let app = app(session.path());
        app.set_live(|live| live.mode = LiveMode::Depth);
        let ending = lock(&app.recorder);
        scope(|threads| {
            let begun = threads.spawn(|| begin_recording(&app));
            sleep(Duration::from_millis(200));
            app.set_live(|live| live.mode = LiveMode::Off);
            drop(ending);
            let refused = begun.join().unwrap().unwrap_err();
            assert!(refused.error.contains("live depth is off"), "{refused:?}");
        });
        assert!(lock(&app.recorder).is_none() && app.state().live.recording.is_none());
    }

    #[test]
    fn a_view_that_ends_late_does_not_end_the_recording_of_the_next_one() {
        let session = tempfile::tempdir().unwrap();
        let app = app(session.path());
        app.set_live(|live| live.mode = LiveMode::Depth);
        app.set_live(|live| live.exposure.0 += 1);
        begin_recording(&app).unwrap();
        app.finish_ended_recording();
        assert!(lock(&app.recorder).is_some());
        app.set_live(|live| live.exposure.0 += 1);
        app.finish_ended_recording();
        assert!(lock(&app.recorder).is_none() && app.state().live.recording.is_none());
    }

    #[test]
    fn the_server_answers_while_a_recording_waits_for_the_disk() {
        let session = tempfile::tempdir().unwrap();
        let app = app(session.path());
        app.set_live(|live| live.mode = LiveMode::Depth);
        begin_recording(&app).unwrap();
        assert_eq!(app.state().live.recording.as_deref(), Some("live-001.pairs"));
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let writing = lock(&app.recorder);
        let request = record(State(Arc::clone(&app)), Body(RecordRequest { on: false }));
        let mut request = Box::pin(request);
        let waits = poll_fn(|context| Poll::Ready(request.as_mut().poll(context).is_pending()));
        assert!(runtime.block_on(waits), "it waits in another thread");
        drop(writing);
        assert!(runtime.block_on(request).is_ok());
        assert!(lock(&app.recorder).is_none() && app.state().live.recording.is_none());
        assert!(session.path().join(FOLDER).join("live-001.pairs").is_file());
    }
}
