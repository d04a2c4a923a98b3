//! Computing depth of a capture, and measuring in it.

use axum::{
    Json,
    extract::{Path, State},
    http::{HeaderMap, StatusCode},
    response::{IntoResponse, Response},
};
use farnear_depth::{
    fill::{FillBy, LowTexture, UnknownCriterion, UnknownFilling},
    pipeline::Settings,
    prepare::{Align, Balance},
};
use farnear_files::{map, npy};
use farnear_workflows::{
    Context, WorkflowError,
    depth::{self, DepthSettings, method::Method, noise::CameraNoise, output::Outputs},
    measure::{self, Measured, Rectangle},
    sessions,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Body, Shared, aside, calibrate, seated};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    lane::Task,
    routes::rig::figures,
    view::Begun,
};

/// Most points of a surface that a page turns: 4 MB, and some ten frames a second without a graphics card.
const MESH_PIXELS: usize = 100_000;

/// How depth is computed; what is not named is as `farnear depth` has it.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthWish {
    /// `ro`, `favaro`, `subbarao` or `subbarao-fourier`.
    pub method: String,
    /// Name of the operators, as `gro:linear`.
    pub operators: Option<String>,
    /// Side of the smoothing window, odd.
    pub smooth_px: usize,
    /// Side of the median window: 1, 3, 5 or 7.
    pub median_px: usize,
    /// Whether regions of low texture are filled.
    pub fill: bool,
    /// How: `surface`, or in the thesis' order as `thesis`; only with `fill`.
    pub fill_by: Option<String>,
    /// What counts as low texture: `energy`, or the thesis' `variance:T`; only with `fill`.
    pub low_texture: Option<String>,
    /// Whether the correction that the session has learned is applied.
    pub corrected: bool,
    /// Name of the capture's folder within which another map is kept; without it the capture's own.
    pub variant: Option<String>,
}

impl Default for DepthWish {
    fn default() -> Self {
        let Settings { smoothing_px, median_px, fill, .. } = Settings::default();
        Self {
            method: "ro".into(),
            operators: None,
            smooth_px: smoothing_px,
            median_px,
            fill,
            fill_by: None,
            low_texture: None,
            corrected: false,
            variant: None,
        }
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

/// What was measured.
#[derive(Serialize, JsonSchema)]
pub struct Figures {
    /// The workflow's figures.
    pub figures: Value,
}

/// Adds the routes.
pub fn routes(api: Api) -> Api {
    api.post::<DepthWish, Begun, _, _>(
        "/api/captures/{capture}/depth",
        For::Seated,
        "Computes the depth of a pair, with its standard deviation.",
        compute,
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

/// The way of filling, and by what it is told what to fill.
fn filling(wish: &DepthWish) -> Result<(FillBy, LowTexture), Failure> {
    let refused = |message: String| Failure::new(StatusCode::BAD_REQUEST, message);
    if !wish.fill && (wish.fill_by.is_some() || wish.low_texture.is_some()) {
        return Err(refused("fill_by and low_texture say how to fill: give fill = true too".into()));
    }
    let by = wish.fill_by.as_deref().map(str::parse).transpose();
    let low = wish.low_texture.as_deref().map(str::parse).transpose();
    Ok((
        by.map_err(|error: UnknownFilling| refused(error.to_string()))?.unwrap_or_default(),
        low.map_err(|error: UnknownCriterion| refused(error.to_string()))?.unwrap_or_default(),
    ))
}

async fn compute(
    State(app): Shared,
    Path(name): Path<String>,
    headers: HeaderMap,
    Body(wish): Body<DepthWish>,
) -> Result<Json<Begun>, Failure> {
    seated(&app, &headers)?;
    let folder = sessions::folder_of(&app.session, &name)?;
    let method: Method = wish.method.parse().map_err(|error: depth::method::UnknownMethod| {
        Failure::new(StatusCode::BAD_REQUEST, format!("method {:?}: {error}", wish.method))
    })?;
    let (fill_by, low_texture) = filling(&wish)?;
    // A path would let the page read any file as operators.
    let named = |text: &String| text.chars().all(|c| c.is_ascii_alphanumeric() || ":-".contains(c));
    if let Some(operators) = wish.operators.as_ref().filter(|text| !named(text)) {
        return Err(Failure::new(
            StatusCode::BAD_REQUEST,
            format!("operators {operators:?}: expected FAMILY:DESIGN"),
        ));
    }
    let out = match &wish.variant {
        Some(variant) => sessions::folder_of(&folder, variant)?,
        None => folder.clone(),
    };
    let settings = DepthSettings {
        far: folder.join("far.png"),
        near: folder.join("near.png"),
        optics: None,
        psf: None,
        operators: wish.operators.map(Into::into),
        method,
        computation: Settings {
            smoothing_px: wish.smooth_px,
            median_px: wish.median_px,
            fill: wish.fill,
            fill_by,
            low_texture,
            threads: 0,
            ..Settings::default()
        },
        window: None,
        align: Align::default(),
        balance: Balance::default(),
        region: None,
        camera: None,
        min_confidence: 0.0,
        correction: wish.corrected.then(|| app.session.join(calibrate::CORRECTION)),
        uncertainty: (method == Method::RationalOperators).then_some(CameraNoise::Estimated),
        write: Outputs::default(),
        out: Some(out),
    };
    let work = move |app: &App, context: &Context<'_>| {
        let computed = depth::compute(&settings, context)?;
        app.change(|state| state.captures += 1);
        figures(computed)
    };
    let task = Task { kind: "depth", title: format!("Depth of {name}"), work: Box::new(work) };
    let job = app.begin_computing(task).map_err(|title| Failure::busy(&title))?;
    Ok(Json(Begun { job }))
}

async fn region(
    State(app): Shared,
    Path(name): Path<String>,
    Body(Region { x, y, width, height }): Body<Region>,
) -> Result<Json<Figures>, Failure> {
    let folder = sessions::folder_of(&app.session, &name)?;
    let at = Rectangle { x, y, width, height };
    let figures = aside(move || Ok(figures(measure::region(&Measured::read(&folder)?, at)?)?)).await?;
    Ok(Json(Figures { figures }))
}

async fn profile(
    State(app): Shared,
    Path(name): Path<String>,
    Body(Line { from, to }): Body<Line>,
) -> Result<Json<Figures>, Failure> {
    let folder = sessions::folder_of(&app.session, &name)?;
    let figures = aside(move || Ok(figures(measure::profile(&Measured::read(&folder)?, from, to)?)?)).await?;
    Ok(Json(Figures { figures }))
}

/// The depth maps of two captures, to be compared.
fn both(app: &App, names: [&str; 2]) -> Result<[std::path::PathBuf; 2], Failure> {
    let [first, second] = names.map(|name| sessions::folder_of(&app.session, name));
    Ok([first?.join("depth.npy"), second?.join("depth.npy")])
}

async fn difference(
    State(app): Shared,
    Path((name, other)): Path<(String, String)>,
) -> Result<Json<Figures>, Failure> {
    let [first, second] = both(&app, [&name, &other])?;
    let figures = aside(move || {
        let maps = [first, second].map(|path| map::read(&path).map_err(WorkflowError::from));
        let [first, second] = maps;
        Ok(figures(measure::difference(&first?, &second?)?.1)?)
    })
    .await?;
    Ok(Json(Figures { figures }))
}

async fn difference_map(
    State(app): Shared,
    Path((name, other)): Path<(String, String)>,
) -> Result<Response, Failure> {
    let [first, second] = both(&app, [&name, &other])?;
    let bytes = aside(move || {
        let [first, second] = [first, second].map(|path| map::read(&path).map_err(WorkflowError::from));
        Ok(npy::write(measure::difference(&first?, &second?)?.0.view()))
    })
    .await?;
    Ok(bytes.into_response())
}

async fn mesh(State(app): Shared, Path(name): Path<String>) -> Result<Response, Failure> {
    let folder = sessions::folder_of(&app.session, &name)?;
    let bytes = aside(move || Ok(measure::mesh(&folder, MESH_PIXELS)?)).await?;
    Ok(bytes.into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(json: &str) -> Result<(FillBy, LowTexture), String> {
        let wish: DepthWish = serde_json::from_str(json).expect("a wish");
        filling(&wish).map_err(|failure| failure.error)
    }

    #[test]
    fn filling_is_asked_for_in_the_command_line_s_words() {
        assert_eq!(asked("{}"), Ok((FillBy::Surface, LowTexture::Energy)));
        assert_eq!(asked(r#"{"fill": true}"#), Ok((FillBy::Surface, LowTexture::Energy)));
        assert_eq!(
            asked(r#"{"fill": true, "fill_by": "thesis", "low_texture": "variance:0.02"}"#),
            Ok((FillBy::Thesis, LowTexture::Variance { below: 0.02 }))
        );
    }

    #[test]
    fn words_that_nobody_knows_and_words_without_filling_are_refused() {
        for (json, phrase) in [
            (r#"{"fill": true, "fill_by": "magic"}"#, "magic"),
            (r#"{"fill": true, "low_texture": "dull"}"#, "dull"),
            (r#"{"low_texture": "variance"}"#, "fill = true"),
        ] {
            assert!(asked(json).is_err_and(|said| said.contains(phrase)), "{json}");
        }
    }
}
