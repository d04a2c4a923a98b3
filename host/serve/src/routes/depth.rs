//! Depth of a capture, and measurements in it.

use axum::{
    Json,
    extract::{Path, State},
    http::StatusCode,
    response::{IntoResponse, Response},
};
use farnear_files::npy;
use farnear_workflows::{
    Context,
    depth::DepthRequest,
    focus_stack::FocusStackRequest,
    measure::{self, Measured, Rectangle},
    request::{self, Paths, Request},
    sessions,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{Body, Shared, aside, calibrate};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    job_queue::Task,
    options::Options,
    routes::rig::{begin_computing, figures},
    view::Begun,
};

/// Most points of a 3-D surface: 4 MB, some ten frames per second without a graphics card.
const MESH_PIXELS: usize = 100_000;

/// A depth request without its files, and the folder of the map.
#[derive(Deserialize)]
pub struct CaptureDepthRequest {
    #[serde(default)]
    corrected: bool,
    /// Folder within the capture for the map.
    variant: Option<String>,
    /// Options of `farnear depth` that name no file, and `operators` as FAMILY:DESIGN.
    #[serde(flatten)]
    options: Map<String, Value>,
}

impl JsonSchema for CaptureDepthRequest {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "CaptureDepthRequest".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = Options::<DepthRequest>::json_schema(generator);
        if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
            let about = "Whether the correction that the session has learned is applied.";
            properties.insert(
                "corrected".into(),
                json!({"type": "boolean", "default": false, "description": about}),
            );
            let about = "Folder within the capture for the map, instead of the capture's own.";
            properties.insert("variant".into(), json!({"type": ["string", "null"], "description": about}));
            let about = "Name of the rational operators: FAMILY:DESIGN.";
            properties.insert("operators".into(), json!({"type": ["string", "null"], "description": about}));
        }
        schema
    }
}

/// A part of the map.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Leftmost column.
    pub x: usize,
    /// Topmost row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// A line in the map.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Column and row of its begin.
    pub from: [usize; 2],
    /// And of its end.
    pub to: [usize; 2],
}

/// Result of a measurement.
#[derive(Serialize, JsonSchema)]
pub struct Figures {
    /// The workflow's figures.
    pub figures: Value,
}

pub fn routes(api: Api) -> Api {
    api.post::<CaptureDepthRequest, Begun, _, _>(
        "/api/captures/{capture}/depth",
        For::Control,
        "Computes the depth of a pair, with its standard deviation.",
        compute,
    )
    .post::<Options<FocusStackRequest>, Begun, _, _>(
        "/api/captures/{capture}/stack",
        For::Control,
        "Computes the depth of a stack by focus, and its sharp image, as the variant `focus-stack`.",
        compute_stack,
    )
    .post::<Region, Figures, _, _>(
        "/api/captures/{capture}/region",
        For::All,
        "Mean, deviation, fill rate and plane of a region.",
        region,
    )
    .post::<Line, Figures, _, _>("/api/captures/{capture}/profile", For::All, "Depths along a line.", profile)
    .get_bytes(
        "/api/captures/{capture}/mesh.ply",
        "The surface as a mesh, as fine as a browser turns it easily.",
        "application/octet-stream",
        mesh,
    )
    .get::<Figures, _, _>(
        "/api/captures/{capture}/difference/{other}",
        "Figures of the other capture's depth minus this one's.",
        difference,
    )
    .get_bytes(
        "/api/captures/{capture}/difference/{other}/map.npy",
        "The same as a map in mm, NumPy's format.",
        "application/octet-stream",
        difference_map,
    )
}

async fn compute(
    State(app): Shared,
    Path(name): Path<String>,
    Body(asked): Body<CaptureDepthRequest>,
) -> Result<Json<Begun>, Failure> {
    let folder = sessions::existing(&app.session, &name)?;
    let CaptureDepthRequest { corrected, variant, mut options } = asked;
    let operators = options.remove("operators").filter(|value| !value.is_null());
    let options: DepthRequest =
        request::parse(options, Paths::Refused).map_err(|error| Failure::bad_request(error.to_string()))?;
    // A path would let the page read any file as operators.
    let is_name = |text: &&str| text.chars().all(|c| c.is_ascii_alphanumeric() || ":-".contains(c));
    let operators = match operators {
        None => None,
        Some(value) => Some(
            value
                .as_str()
                .filter(is_name)
                .ok_or_else(|| Failure::bad_request(format!("operators {value}: expected FAMILY:DESIGN")))?
                .into(),
        ),
    };
    let out = match &variant {
        Some(variant) => sessions::variant_of(&folder, variant)?,
        None => folder.clone(),
    };
    let request = DepthRequest {
        far: folder.join("far.png"),
        near: folder.join("near.png"),
        operators,
        correction: corrected.then(|| app.session.join(calibrate::CORRECTION)),
        out: Some(out),
        ..options
    };
    begin(&app, &name, request)
}

/// Computes a map of a capture in the background.
fn begin(app: &App, name: &str, request: impl Request) -> Result<Json<Begun>, Failure> {
    request.check()?;
    let work = move |app: &App, context: &Context<'_>| {
        let computed = request.run(context)?;
        app.change(|state| state.captures += 1);
        Ok(computed)
    };
    begin_computing(app, Task::new("depth", format!("Depth of {name}"), work))
}

async fn compute_stack(
    State(app): Shared,
    Path(name): Path<String>,
    Body(Options(options)): Body<Options<FocusStackRequest>>,
) -> Result<Json<Begun>, Failure> {
    let folder = sessions::existing(&app.session, &name)?;
    let out = sessions::variant_of(&folder, sessions::STACK_VARIANT)?;
    let request = FocusStackRequest { stack: folder, out, ..options };
    begin(&app, &name, request)
}

/// Folder of a capture's map.
fn with_map(app: &App, name: &str) -> Result<std::path::PathBuf, Failure> {
    let folder = sessions::with_map(sessions::existing(&app.session, name)?);
    if !["depth.npy", "depth.tiff", "depth.png"].iter().any(|map| folder.join(map).exists()) {
        let error = format!("{name} has no depth yet");
        return Err(Failure::new(StatusCode::NOT_FOUND, error).with_hint("Compute its depth first."));
    }
    Ok(folder)
}

async fn region(
    State(app): Shared,
    Path(name): Path<String>,
    Body(Region { x, y, width, height }): Body<Region>,
) -> Result<Json<Figures>, Failure> {
    let folder = with_map(&app, &name)?;
    let at = Rectangle { x, y, width, height };
    let figures = aside(move || Ok(figures(measure::region(&Measured::read(&folder)?, at)?)?)).await?;
    Ok(Json(Figures { figures }))
}

async fn profile(
    State(app): Shared,
    Path(name): Path<String>,
    Body(Line { from, to }): Body<Line>,
) -> Result<Json<Figures>, Failure> {
    let folder = with_map(&app, &name)?;
    let figures = aside(move || Ok(figures(measure::profile(&Measured::read(&folder)?, from, to)?)?)).await?;
    Ok(Json(Figures { figures }))
}

fn both(app: &App, names: [&str; 2]) -> Result<[std::path::PathBuf; 2], Failure> {
    let [first, second] = names.map(|name| with_map(app, name));
    Ok([first?, second?])
}

async fn difference(
    State(app): Shared,
    Path((name, other)): Path<(String, String)>,
) -> Result<Json<Figures>, Failure> {
    let [first, second] = both(&app, [&name, &other])?;
    let figures =
        aside(move || Ok(figures(measure::difference(&first, &second, &Context::unattended())?.1)?)).await?;
    Ok(Json(Figures { figures }))
}

async fn difference_map(
    State(app): Shared,
    Path((name, other)): Path<(String, String)>,
) -> Result<Response, Failure> {
    let [first, second] = both(&app, [&name, &other])?;
    let bytes =
        aside(move || Ok(npy::write(measure::difference(&first, &second, &Context::unattended())?.0.view())))
            .await?;
    Ok(bytes.into_response())
}

async fn mesh(State(app): Shared, Path(name): Path<String>) -> Result<Response, Failure> {
    let folder = with_map(&app, &name)?;
    let bytes = aside(move || Ok(measure::mesh(&folder, MESH_PIXELS)?)).await?;
    Ok(bytes.into_response())
}
