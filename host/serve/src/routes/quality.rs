use axum::{Json, extract::State};
use farnear_workflows::{
    Context,
    request::Request,
    rig::{
        RigAddress,
        quality::{self, QualityRequest},
    },
};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::{Body, Shared, aside};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    job_queue::Task,
    options::Options,
    routes::rig::{begin, connected, figures},
    view::Begun,
};

const RECORD: &str = "quality.toml";

/// The measurements so far.
#[derive(Serialize, JsonSchema)]
pub struct Records {
    /// The oldest first.
    pub records: Vec<Value>,
}

pub fn routes(api: Api) -> Api {
    api.get::<Records, _, _>("/api/quality", "The measurements of depth quality so far.", list)
        .post::<Options<QualityRequest>, Begun, _, _>(
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
    Body(Options(options)): Body<Options<QualityRequest>>,
) -> Result<Json<Begun>, Failure> {
    let request = QualityRequest {
        rig: RigAddress::Open(connected(&app)?),
        camera: app.camera(),
        optics: app.optics_file(),
        record: app.session.join(RECORD),
        ..options
    };
    request.check()?;
    let title = format!("Depth quality over {} pairs", request.pairs);
    let work = move |_: &App, context: &Context<'_>| request.run(context);
    begin(&app, Task::new("quality", title, work))
}
