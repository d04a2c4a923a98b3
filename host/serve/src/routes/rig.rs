//! Motion of the rig, and its live view.

use axum::{Json, extract::State, http::StatusCode};
use farnear_depth::focus_measure::{FocusError, FocusMeasure};
use farnear_protocol::{Micros, message::Axis};
use farnear_workflows::{
    Context, WorkflowError,
    measure::Rectangle,
    optics,
    request::{Request, RigRequest},
    rig::{
        RigAddress, alarms, board,
        camera::light_of_percent,
        check::CheckRequest,
        focus::FocusRequest,
        goto::{self, GotoSettings},
        motion::{HomeRequest, MoveRequest},
        open::OpenRig,
    },
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
    view::{Begun, DONE, Done, LiveMode, Nothing},
};

const EXPOSURE_MAX_US: u32 = 1_000_000;
/// Scenes of `farnear-sim` without a parameter.
const SCENES: [&str; 4] = ["staircase", "slant", "cone", "sphere"];

/// One of the images of a pair.
#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FocusName {
    /// Sharp at the far end of the working range.
    Far,
    /// Sharp at its near end.
    Near,
}

/// To the focus of the far or the near image.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goto {
    /// Far or near focus.
    pub focus: FocusName,
}

/// Live settings; absent fields stay unchanged.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LiveRequest {
    /// Live mode.
    #[serde(default)]
    pub mode: Option<LiveMode>,
    /// Length of an exposure, also of captures.
    #[serde(default)]
    pub exposure_us: Option<u32>,
    /// Brightness of the board's light outputs in percent, during captures and live depth.
    #[serde(default)]
    pub light_percent: Option<[f64; 2]>,
    /// `fft-sum`, `tenengrad` or `modified-laplacian`.
    #[serde(default)]
    pub measure: Option<String>,
    /// Part of the live image that its figures describe: column, row, width, height in pixels; width 0: all.
    #[serde(default)]
    pub region: Option<[usize; 4]>,
}

/// Scene of the emulated rig.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// `staircase`, `slant`, `cone`, `sphere` or `plane:MM`, or the scene that the program was started with.
    pub scene: String,
}

/// The alarm to clear.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clear {
    /// Number of the alarm to clear.
    pub number: u32,
}

/// The alarms that the board keeps.
#[derive(Serialize, JsonSchema)]
pub struct Alarms {
    /// As `farnear rig alarms --json` prints them.
    pub figures: Value,
}

pub fn routes(api: Api) -> Api {
    api.post::<Nothing, Done, _, _>("/api/rig/connect", For::Control, "Connects to the rig again.", connect)
        .post::<Scene, Done, _, _>(
            "/api/rig/scene",
            For::Control,
            "Restarts the emulated rig with another scene.",
            set_scene,
        )
        .post::<Options<HomeRequest>, Begun, _, _>("/api/rig/home", For::Control, "Homes axes.", home)
        .post::<Options<MoveRequest>, Begun, _, _>(
            "/api/rig/move",
            For::Control,
            "Moves axes to absolute positions.",
            move_to,
        )
        .post::<Goto, Begun, _, _>("/api/rig/goto", For::Control, "Moves to the far or the near focus.", go)
        .post::<Options<FocusRequest>, Begun, _, _>(
            "/api/rig/focus",
            For::Control,
            "Finds the focus of a target and stays there.",
            seek,
        )
        .post::<Nothing, Begun, _, _>(
            "/api/rig/check",
            For::Control,
            "The bring-up checklist, step by step.",
            checklist,
        )
        .post::<Nothing, Begun, _, _>("/api/rig/reset", For::Control, "Resets the board.", reset)
        .post::<LiveRequest, Done, _, _>("/api/live", For::Control, "Sets the live view.", live)
        .get::<Alarms, _, _>(
            "/api/rig/alarms",
            "The alarms that the board keeps, the last one first.",
            list_alarms,
        )
        .post::<Clear, Begun, _, _>("/api/rig/alarms/clear", For::Control, "Clears the latched alarm.", clear)
}

pub fn connected(app: &App) -> Result<OpenRig, Failure> {
    let state = app.state().rig;
    app.rig().ok_or_else(|| {
        let why = state.error.unwrap_or_else(|| "no rig is connected".into());
        Failure::new(StatusCode::SERVICE_UNAVAILABLE, why)
            .with_hint("Start `farnear serve` with --rig sim or a port, or connect again.")
    })
}

pub fn begin(app: &App, task: Task) -> Result<Json<Begun>, Failure> {
    let job = app.begin_on_rig(task).map_err(|title| Failure::busy(&title))?;
    Ok(Json(Begun { job }))
}

pub fn begin_computing(app: &App, task: Task) -> Result<Json<Begun>, Failure> {
    let job = app.begin_computing(task).map_err(|title| Failure::busy(&title))?;
    Ok(Json(Begun { job }))
}

pub fn figures(figures: impl Serialize) -> farnear_workflows::Result<Value> {
    let nowhere = std::path::Path::new("the figures");
    serde_json::to_value(figures).map_err(WorkflowError::file(nowhere, "plain values"))
}

async fn connect(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Result<Json<Done>, Failure> {
    if app.address.is_none() {
        connected(&app)?;
    }
    connect_again(&app, || ())
}

fn connect_again(app: &App, prepare: impl FnOnce()) -> Result<Json<Done>, Failure> {
    if app.rig_jobs.is_busy() {
        return Err(Failure::busy("a job on the rig"));
    }
    prepare();
    app.interrupt_live();
    app.ask_to_connect();
    Ok(Json(DONE))
}

async fn set_scene(State(app): Shared, Body(Scene { scene }): Body<Scene>) -> Result<Json<Done>, Failure> {
    let given = app.address.as_ref().filter(|address| address.is_emulated());
    let given = given.ok_or_else(|| Failure::bad_request("only an emulated rig can change its scene"))?;
    let address = match given.scene().as_ref() == Some(&scene) {
        true => given.clone(), // it may be a file
        false => given.with_scene(known(scene, &app)?)?,
    };
    connect_again(&app, || app.choose_rig(address))
}

/// Fails for a scene that `farnear-sim` does not know by name or that the session's lens cannot image.
fn known(scene: String, app: &App) -> Result<String, Failure> {
    let distance_mm = scene.strip_prefix("plane:").and_then(|text| text.parse::<f64>().ok());
    let focal_length_mm = optics::read(&app.optics_file())?.focal_length_mm();
    let expected = match distance_mm {
        None if SCENES.contains(&scene.as_str()) => return Ok(scene),
        None => format!("{} or plane:MM", SCENES.join(", ")),
        Some(mm) if mm > focal_length_mm && mm.is_finite() => return Ok(scene),
        Some(_) => format!("a distance beyond the focal length of {focal_length_mm} mm"),
    };
    Err(Failure::bad_request(format!("scene {scene:?}: expected {expected}")))
}

async fn home(
    State(app): Shared,
    Body(Options(mut request)): Body<Options<HomeRequest>>,
) -> Result<Json<Begun>, Failure> {
    request.set_rig(RigAddress::Open(connected(&app)?));
    begin(&app, Task::new("home", "Home", move |_, context| request.run(context)))
}

async fn move_to(
    State(app): Shared,
    Body(Options(mut request)): Body<Options<MoveRequest>>,
) -> Result<Json<Begun>, Failure> {
    request.set_rig(RigAddress::Open(connected(&app)?));
    request.check()?;
    let targets = request.axis.iter().zip(&request.to_um);
    let words: Vec<_> =
        targets.map(|(axis, to_um)| format!("{} to {to_um:.3} um", Axis::from(*axis).name())).collect();
    let title = format!("Move {}", words.join(", "));
    begin(&app, Task::new("move", title, move |_, context| request.run(context)))
}

async fn go(State(app): Shared, Body(request): Body<Goto>) -> Result<Json<Begun>, Failure> {
    let rig = RigAddress::Open(connected(&app)?);
    let (focus, title) = match request.focus {
        FocusName::Far => (goto::Focus::Far, "Go to the far focus"),
        FocusName::Near => (goto::Focus::Near, "Go to the near focus"),
    };
    let settings = GotoSettings { rig, optics: app.optics_file(), focus };
    begin(&app, Task::new("goto", title, move |_, context| goto::goto(&settings, context)))
}

fn measure(name: &str) -> Result<FocusMeasure, Failure> {
    name.parse().map_err(|error: FocusError| Failure::bad_request(error.to_string()))
}

async fn seek(
    State(app): Shared,
    Body(Options(options)): Body<Options<FocusRequest>>,
) -> Result<Json<Begun>, Failure> {
    let rig = RigAddress::Open(connected(&app)?);
    let request = FocusRequest { rig, camera: app.camera(), optics: app.optics_file(), ..options };
    request.check()?;
    begin(&app, Task::new("focus", "Find the focus", move |_, context| request.run(context)))
}

async fn checklist(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Result<Json<Begun>, Failure> {
    let rig = connected(&app)?;
    let settings =
        CheckRequest { rig: RigAddress::Open(rig), camera: app.camera(), ..CheckRequest::default() };
    begin(&app, Task::new("check", "Bring-up checklist", move |_, context| settings.run(context)))
}

async fn reset(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Result<Json<Begun>, Failure> {
    let rig = RigAddress::Open(connected(&app)?);
    begin(&app, Task::new("reset", "Reset the board", move |_, context| board::reset(&rig, context)))
}

async fn live(State(app): Shared, Body(request): Body<LiveRequest>) -> Result<Json<Done>, Failure> {
    let info = app.state().rig.info;
    let limit = |name: &str| info.as_ref().and_then(|info| u32::try_from(info[name].as_u64()?).ok());
    let min_us = limit("exposure_min_us").unwrap_or(1);
    let max_us = limit("exposure_max_us").unwrap_or(EXPOSURE_MAX_US);
    if let Some(us) = request.exposure_us.filter(|us| !(min_us..=max_us).contains(us)) {
        return Err(Failure::bad_request(format!("exposure_us {us}: expected {min_us} to {max_us} us")));
    }
    let wrong = |reason: String| Failure::bad_request(format!("light_percent: {reason}"));
    let light = request.light_percent.map(light_of_percent).transpose().map_err(wrong)?;
    let measure = request.measure.as_deref().map(measure).transpose()?;
    app.set_live(|live| {
        if let Some(levels) = light {
            live.light = Some(levels);
        }
        live.mode = request.mode.unwrap_or(live.mode);
        live.exposure = request.exposure_us.map_or(live.exposure, Micros);
        live.measure = measure.unwrap_or(live.measure);
        if let Some(region) = request.region {
            live.region =
                Some(Rectangle::from(region)).filter(|region| region.width > 0 && region.height > 0);
        }
    });
    Ok(Json(DONE))
}

async fn list_alarms(State(app): Shared) -> Result<Json<Alarms>, Failure> {
    let rig = RigAddress::Open(connected(&app)?);
    let context = Context::unattended();
    let figures = aside(move || Ok(figures(alarms::alarms(&rig, None, &context)?)?)).await?;
    Ok(Json(Alarms { figures }))
}

async fn clear(State(app): Shared, Body(Clear { number }): Body<Clear>) -> Result<Json<Begun>, Failure> {
    let rig = RigAddress::Open(connected(&app)?);
    let work = move |_: &App, context: &Context<'_>| alarms::alarms(&rig, Some(number), context);
    begin(&app, Task::new("alarm", format!("Clear alarm {number}"), work))
}
