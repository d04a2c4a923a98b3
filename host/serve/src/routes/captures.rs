//! Capturing, and stored captures.

use std::time::Duration;

use axum::{
    Json,
    extract::{Path, Query, State},
    http::Method,
};
use farnear_workflows::{
    Context,
    request::Request,
    rig::{
        AxisName, RigAddress,
        pair::{self, CaptureRequest as PairRequest},
        sequence::SequenceRequest,
        series::{self, SeriesSettings},
    },
    sessions::{self, Note},
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use serde_json::{Number, Value};

use super::{Body, Shared, aside};
use crate::{
    api::{Api, For},
    app::App,
    depth_message::show_fresh,
    failure::Failure,
    job_queue::Task,
    routes::rig::{begin, connected, figures},
    view::{Begun, DONE, Done, Nothing},
};

const SERIES_MAX: usize = 500;

/// Kind of capture.
#[derive(Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum CaptureRequest {
    /// A far- and a near-focused image.
    Pair {
        /// The new capture's name; the next free number without one.
        #[serde(default)]
        name: Option<String>,
        /// Exposures that each image is the mean of, 1 to 256.
        #[serde(default = "once")]
        averaged: u16,
        /// Whether images without the board's light are subtracted.
        #[serde(default)]
        subtract_ambient: bool,
    },
    /// Several pairs, one after the other.
    Series {
        /// Number of pairs.
        pairs: usize,
        /// Seconds from the start of a pair to that of the next, 0 to 86,400; a pair that takes longer delays the next one.
        #[serde(default, deserialize_with = "number")]
        interval_s: f64,
    },
    /// One image where the sensor stands.
    Still {},
    /// A focus stack over positions of one axis.
    Stack {
        /// The axis that goes through it.
        axis: AxisName,
        /// First position, um.
        #[serde(deserialize_with = "number")]
        from_um: f64,
        /// Last position, um.
        #[serde(deserialize_with = "number")]
        to_um: f64,
        /// Number of images, 1 to 10,000.
        steps: usize,
    },
}

fn once() -> u16 {
    1
}

/// Reads the fields of a tagged enum: with serde_json's `arbitrary_precision`, which a dependency enables, they are
/// stored in a form that `f64` does not accept.
fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let number = Number::deserialize(deserializer)?;
    number.as_f64().ok_or_else(|| D::Error::custom(format!("{number}: expected a number below 1e308")))
}

/// That a capture was begun.
#[derive(Serialize, JsonSchema)]
pub struct Capturing {
    /// The job's number.
    pub job: u64,
    /// The names of the captures to come.
    pub names: Vec<String>,
}

/// The captures of the session.
#[derive(Serialize, JsonSchema)]
pub struct Captures {
    /// Each with name, kind, images, files, optics, note.
    pub captures: Vec<Value>,
}

/// A capture of the session.
#[derive(Serialize, JsonSchema)]
pub struct OneCapture {
    /// Name, kind, images, files, optics, note.
    pub capture: Value,
}

#[derive(Deserialize)]
pub struct Search {
    #[serde(default)]
    search: String,
}

/// A note to a capture.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoteBody {
    /// 0 (not rated) to 5.
    pub rating: u8,
    /// Free text of the note.
    pub text: String,
}

/// New name of a capture.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenameRequest {
    /// Of a capture that does not exist yet.
    pub name: String,
}

pub fn routes(api: Api) -> Api {
    api.get::<Captures, _, _>("/api/captures", "The captures of the session, by name.", list)
        .query("/api/captures", "search", "Words that record, optics or note hold.")
        .post::<CaptureRequest, Capturing, _, _>(
            "/api/captures",
            For::Control,
            "Captures a pair, a series, a still or a stack.",
            capture,
        )
        .get::<OneCapture, _, _>("/api/captures/{capture}", "One capture.", one)
        .change::<Nothing, Done, _, _>(
            "/api/captures/{capture}",
            Method::DELETE,
            For::Control,
            "Deletes a capture with all of its files.",
            delete,
        )
        .post::<RenameRequest, Done, _, _>(
            "/api/captures/{capture}/rename",
            For::Control,
            "Renames a capture.",
            rename,
        )
        .change::<NoteBody, Done, _, _>(
            "/api/captures/{capture}/note",
            Method::PUT,
            For::Client,
            "Rating and note of a capture.",
            note,
        )
}

async fn list(
    State(app): Shared,
    Query(Search { search }): Query<Search>,
) -> Result<Json<Captures>, Failure> {
    let captures = aside(move || {
        let found = sessions::list(&app.session, &search)?;
        found.into_iter().map(|capture| Ok(figures(capture)?)).collect::<Result<Vec<_>, Failure>>()
    })
    .await?;
    Ok(Json(Captures { captures }))
}

async fn one(State(app): Shared, Path(name): Path<String>) -> Result<Json<OneCapture>, Failure> {
    let folder = sessions::existing(&app.session, &name)?;
    let capture = aside(move || Ok(figures(sessions::read(&folder)?)?)).await?;
    Ok(Json(OneCapture { capture }))
}

async fn delete(
    State(app): Shared,
    Path(name): Path<String>,
    Body(Nothing {}): Body<Nothing>,
) -> Result<Json<Done>, Failure> {
    idle(&app)?;
    sessions::delete(&app.session, &name)?;
    app.note(format!("deleted {name}"));
    app.change(|state| state.captures += 1);
    Ok(Json(DONE))
}

async fn rename(
    State(app): Shared,
    Path(name): Path<String>,
    Body(RenameRequest { name: to }): Body<RenameRequest>,
) -> Result<Json<Done>, Failure> {
    idle(&app)?;
    sessions::rename(&app.session, &name, &to)?;
    app.change(|state| state.captures += 1);
    Ok(Json(DONE))
}

/// Files of a capture do not change while a job runs.
fn idle(app: &App) -> Result<(), Failure> {
    match app.rig_jobs.is_busy() || app.computing.is_busy() {
        true => Err(Failure::busy("a job that may use the capture")),
        false => Ok(()),
    }
}

async fn note(
    State(app): Shared,
    Path(name): Path<String>,
    Body(NoteBody { rating, text }): Body<NoteBody>,
) -> Result<Json<Done>, Failure> {
    let folder = sessions::existing(&app.session, &name)?;
    sessions::write_note(&folder, &Note { rating, text })?;
    app.change(|state| state.captures += 1);
    Ok(Json(DONE))
}

async fn capture(
    State(app): Shared,
    Body(request): Body<CaptureRequest>,
) -> Result<Json<Capturing>, Failure> {
    let rig = RigAddress::Open(connected(&app)?);
    let (camera, optics) = (app.camera(), app.optics_file());
    let free = |kind, count| sessions::free_names(&app.session, kind, count);
    let images = |axis, from, to, steps| SequenceRequest {
        axis: Some(axis),
        from: Some(from),
        to: Some(to),
        steps: Some(steps),
        ..SequenceRequest::default()
    };
    let (task, out) = match request {
        CaptureRequest::Pair { name, averaged, subtract_ambient } => {
            let out = match name {
                Some(name) => sessions::new_capture(&app.session, &name)?,
                None => free("pair", 1)?.remove(0),
            };
            let settings = PairRequest {
                rig,
                camera,
                optics,
                average: averaged,
                subtract_ambient,
                out: out.clone(),
                ..PairRequest::default()
            };
            settings.check()?;
            let capture = name_of(&out);
            let work = move |app: &App, context: &Context<'_>| {
                let captured = pair::capture_seen(&settings, context, |pair| {
                    show_fresh(app, &capture, &pair.far.image, &pair.near.image);
                });
                kept(app, captured)
            };
            (Task::new("pair", "Capture a pair", work), vec![out])
        }
        CaptureRequest::Series { pairs, interval_s } => {
            if !(0.0..=86_400.0).contains(&interval_s) {
                return Err(Failure::bad_request(format!("interval_s {interval_s}: expected 0 to 86400")));
            }
            if !(1..=SERIES_MAX).contains(&pairs) {
                return Err(Failure::bad_request(format!("pairs {pairs}: expected 1 to {SERIES_MAX}")));
            }
            let out = free("series", pairs)?;
            let interval = Duration::from_secs_f64(interval_s);
            let settings = SeriesSettings { rig, camera, optics, interval, out: out.clone() };
            let work = move |app: &App, context: &Context<'_>| kept(app, series::capture(&settings, context));
            (Task::new("series", format!("Capture {pairs} pairs"), work), out)
        }
        CaptureRequest::Still {} => {
            let info = app.state().rig.info;
            let fine_um =
                info.as_ref().and_then(|info| info["fine"]["asked_um"].as_f64()).unwrap_or_default();
            let limit = |name: &str, otherwise| {
                info.as_ref().and_then(|info| info[name].as_f64()).unwrap_or(otherwise)
            };
            let at_um = fine_um.clamp(limit("fine_min_um", fine_um), limit("fine_max_um", fine_um));
            let out = free("still", 1)?.remove(0);
            let still = images(AxisName::Fine, at_um, at_um, 1);
            let settings = SequenceRequest { rig, camera, optics: Some(optics), out: out.clone(), ..still };
            let work = move |app: &App, context: &Context<'_>| kept(app, settings.run(context));
            (Task::new("still", "Capture a still", work), vec![out])
        }
        CaptureRequest::Stack { axis, from_um, to_um, steps } => {
            let out = free("stack", 1)?.remove(0);
            let stack = images(axis, from_um, to_um, steps);
            let settings = SequenceRequest { rig, camera, optics: Some(optics), out: out.clone(), ..stack };
            settings.check()?;
            let work = move |app: &App, context: &Context<'_>| kept(app, settings.run(context));
            (Task::new("stack", format!("Capture {steps} images"), work), vec![out])
        }
    };
    let names = out.iter().map(|folder| name_of(folder)).collect();
    let Json(Begun { job }) = begin(&app, task)?;
    Ok(Json(Capturing { job, names }))
}

fn name_of(folder: &std::path::Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Lists the captures again: those that are complete stay, also of a series that was stopped.
fn kept<T>(app: &App, found: farnear_workflows::Result<T>) -> farnear_workflows::Result<T> {
    app.change(|state| state.captures += 1);
    found
}
