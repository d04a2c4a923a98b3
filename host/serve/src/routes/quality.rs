use axum::{Json, extract::State, http::HeaderMap};
use farnear_workflows::{
    Context,
    rig::{
        RigAddress,
        quality::{self, QualitySettings},
    },
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Body, Shared, aside, require_control};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    job_queue::Task,
    routes::rig::{begin, connected, figures},
    view::Begun,
};

const RECORD: &str = "quality.toml";

/// Options of the measurement.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QualityRequest {
    /// Number of pairs, 2 to 50.
    pub pairs: usize,
    /// How far the target is, where that is known.
    #[serde(default)]
    pub true_mm: Option<f64>,
}

/// The measurements so far.
#[derive(Serialize, JsonSchema)]
pub struct Records {
    /// The oldest first.
    pub records: Vec<Value>,
}

pub fn routes(api: Api) -> Api {
    api.get::<Records, _, _>("/api/quality", "The measurements of depth quality so far.", list)
        .post::<QualityRequest, Begun, _, _>(
            "/api/quality",
            For::Control,
            "Measures fill rate, plane fit, noise and accuracy on a flat target.",
            measure,
        )
}

async fn list(State(app): Shared) -> Result<Json<Records>, Failure> {
    let records = aside(move || {
        let record = quality::read_record(&app.session.join(RECORD))?;
        record.measurements.into_iter().map(|one| Ok(figures(one)?)).collect::<Result<Vec<_>, Failure>>()
    })
    .await?;
    Ok(Json(Records { records }))
}

async fn measure(
    State(app): Shared,
    headers: HeaderMap,
    Body(QualityRequest { pairs, true_mm }): Body<QualityRequest>,
) -> Result<Json<Begun>, Failure> {
    require_control(&app, &headers)?;
    let settings = QualitySettings {
        rig: RigAddress::Open(connected(&app)?),
        camera: app.camera(),
        optics: app.optics_file(),
        pairs,
        true_mm,
        record: app.session.join(RECORD),
    };
    let work = move |_: &App, context: &Context<'_>| figures(quality::measure(&settings, context)?);
    begin(
        &app,
        Task { kind: "quality", title: format!("Depth quality over {pairs} pairs"), work: Box::new(work) },
    )
}
