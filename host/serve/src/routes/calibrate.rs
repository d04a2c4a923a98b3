//! Calibration of the PSF, and a correction from flat targets.

use std::{
    fs,
    path::{Path as FsPath, PathBuf},
};

use axum::{Json, extract::State};
use farnear_depth::{calibrate::Model, corrections::Method, optics::OpticsFile};
use farnear_workflows::{
    Context, WorkflowError,
    calibrate::{
        correction::{self, CalibrateCorrectionRequest},
        psf::CalibratePsfRequest,
    },
    optics::GivenOptics,
    request::Request,
    rig::{
        RigAddress,
        lens_stack::{self, RigStackRequest},
        targets::TargetSeriesRequest,
    },
    sessions,
    simulator::Scenery,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, Shared, aside};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    job_queue::Task,
    options::Options,
    routes::rig::{begin, begin_computing, connected, figures},
    view::{Begun, Nothing},
};

pub const CORRECTION: &str = "correction.toml";
const SERIES: &str = "flat-series";
const LIST: &str = "PATTERNS.toml";

/// A capture of a flat target.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// The capture's name.
    pub capture: String,
    /// How far the target stood, where that is known.
    #[serde(default)]
    pub depth_mm: Option<f64>,
}

/// What the point spread function is found from.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PsfRequest {
    /// Pairs of flat targets.
    #[serde(default)]
    pub targets: Vec<Target>,
    /// Whether the pairs of the flat series count, too, with their distances.
    #[serde(default)]
    pub series: bool,
    /// `gaussian` (k) or `generalised` (p and k).
    pub model: String,
}

/// What the session has been taught.
#[derive(Serialize, JsonSchema)]
pub struct Taught {
    /// Distances of the flat series' targets so far.
    pub series_mm: Vec<f64>,
    /// Whether there is a correction.
    pub corrected: bool,
    /// Names of the corrections that can be learned.
    pub methods: Vec<String>,
}

pub fn routes(api: Api) -> Api {
    api.get::<Taught, _, _>("/api/calibrate", "What this session has been taught.", taught)
        .post::<PsfRequest, Begun, _, _>(
            "/api/calibrate/psf",
            For::Client,
            "Finds the point spread function from one pair or several of flat targets.",
            find_psf,
        )
        .post::<Options<RigStackRequest>, Begun, _, _>(
            "/api/calibrate/stack",
            For::Control,
            "Takes a stack of a flat target around its focus and calibrates the lens from it; the result has the optics.",
            lens_of_stack,
        )
        .post::<Options<TargetSeriesRequest>, Begun, _, _>(
            "/api/calibrate/series",
            For::Control,
            "Captures flat targets at several distances; at a real rig a person places them and answers.",
            series,
        )
        .post::<Nothing, Begun, _, _>(
            "/api/calibrate/series/forget",
            For::Control,
            "Forgets the flat series and the correction, to start again.",
            forget,
        )
        .post::<Options<CalibrateCorrectionRequest>, Begun, _, _>(
            "/api/calibrate/correction",
            For::Client,
            "Learns a correction from the flat series.",
            learn,
        )
}

/// Depth maps of the series with their distances, mm; empty before the first.
fn patterns(app: &App) -> Result<Vec<(PathBuf, f64)>, WorkflowError> {
    let list = app.session.join(SERIES).join(LIST);
    if !list.is_file() {
        return Ok(Vec::new());
    }
    let folder = app.session.join(SERIES);
    let entries = correction::list(&list)?;
    Ok(entries.into_iter().map(|(map, mm)| (folder.join(map), mm)).collect())
}

async fn taught(State(app): Shared) -> Result<Json<Taught>, Failure> {
    aside(move || {
        let series_mm = patterns(&app)?.into_iter().map(|(_, mm)| mm).collect();
        let methods = Method::ALL.iter().map(ToString::to_string).collect();
        Ok(Json(Taught { series_mm, corrected: app.session.join(CORRECTION).is_file(), methods }))
    })
    .await
}

async fn find_psf(State(app): Shared, Body(asked): Body<PsfRequest>) -> Result<Json<Begun>, Failure> {
    let model: Model = asked
        .model
        .parse()
        .map_err(|error| Failure::bad_request(format!("model {:?}: {error}", asked.model)))?;
    let mut request =
        CalibratePsfRequest { optics: app.optics_file(), model, ..CalibratePsfRequest::default() };
    let mut add = |folder: &FsPath, depth_mm: f64| {
        request.images.extend(["far.png", "near.png"].map(|name| folder.join(name)));
        request.depth_mm.push(depth_mm);
    };
    for Target { capture, depth_mm } in asked.targets {
        add(&sessions::existing(&app.session, &capture)?, depth_mm.unwrap_or(0.0));
    }
    if asked.series {
        for (map, mm) in patterns(&app)? {
            add(map.parent().unwrap_or(FsPath::new("")), mm);
        }
    }
    if request.images.is_empty() {
        return Err(Failure::bad_request("no pair was chosen: capture a flat, textured target first"));
    }
    let work = move |_: &App, context: &Context<'_>| request.run(context);
    begin_computing(&app, Task::new("psf", "Find the point spread function", work))
}

async fn series(
    State(app): Shared,
    Body(Options(options)): Body<Options<TargetSeriesRequest>>,
) -> Result<Json<Begun>, Failure> {
    let open = connected(&app)?;
    // The scene of the visible emulated rig is fixed, so each target gets its own rig.
    let (rig, ask) = match &app.address {
        // Its stages are not visible, so it need not run in real time.
        Some(RigAddress::Emulated(scenery)) => {
            (RigAddress::Emulated(Scenery { paced: false, ..scenery.clone() }), false)
        }
        _ => (RigAddress::Open(open), true),
    };
    let settings = TargetSeriesRequest {
        rig,
        camera: app.camera(),
        optics: app.optics_file(),
        no_prompt: !ask,
        out: app.session.join(SERIES),
        ..options
    };
    let work = move |_: &App, context: &Context<'_>| settings.run(context);
    begin(&app, Task::new("flat-series", "Capture flat targets", work))
}

async fn lens_of_stack(
    State(app): Shared,
    Body(Options(options)): Body<Options<RigStackRequest>>,
) -> Result<Json<Begun>, Failure> {
    let open = connected(&app)?;
    let rig = match &app.address {
        // Another emulated rig sees a flat target; its stages are not visible.
        Some(RigAddress::Emulated(scenery)) => {
            let middle_mm = GivenOptics::read(&app.optics_file())?.optics.working_range().alpha0_mm;
            RigAddress::Emulated(Scenery { paced: false, ..scenery.clone() })
                .with_scene(format!("plane:{middle_mm:.3}"))?
        }
        _ => RigAddress::Open(open),
    };
    let out = sessions::free_names(&app.session, "lens", 1)?.remove(0);
    let settings =
        RigStackRequest { rig, camera: app.camera(), optics: app.optics_file(), out: out.clone(), ..options };
    settings.check()?;
    let work = move |app: &App, context: &Context<'_>| {
        let found = lens_stack::run(&settings, context);
        app.change(|state| state.captures += 1);
        let mut figures = figures(found?)?;
        let lens = GivenOptics::read(&out.join(lens_stack::LENS))?.optics;
        figures["optics"] = self::figures(OpticsFile::from(lens))?;
        Ok(figures)
    };
    begin(&app, Task::new("lens-stack", "Calibrate the lens", work))
}

async fn forget(State(app): Shared, Body(Nothing {}): Body<Nothing>) -> Result<Json<Begun>, Failure> {
    let work = move |app: &App, _: &Context<'_>| {
        let (series, file) = (app.session.join(SERIES), app.session.join(CORRECTION));
        for (path, gone) in [(&series, fs::remove_dir_all(&series)), (&file, fs::remove_file(&file))] {
            match gone {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(WorkflowError::Folder { folder: path.clone(), source: error });
                }
                _ => {}
            }
        }
        Ok(())
    };
    begin_computing(&app, Task::new("forget", "Forget the flat series", work))
}

async fn learn(
    State(app): Shared,
    Body(Options(options)): Body<Options<CalibrateCorrectionRequest>>,
) -> Result<Json<Begun>, Failure> {
    let settings = CalibrateCorrectionRequest {
        patterns: app.session.join(SERIES).join(LIST),
        out: app.session.join(CORRECTION),
        ..options
    };
    let work = move |_: &App, context: &Context<'_>| settings.run(context);
    begin_computing(&app, Task::new("correction", "Learn the correction", work))
}
