//! The optics and quantities derived from them.

use axum::{Json, extract::State, http::HeaderMap};
use farnear_depth::optics::OpticsFile;
use farnear_files::staging::write_file;
use farnear_workflows::{
    WorkflowError,
    lens_table::{self, Readings},
    optics::GivenOptics,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Body, Shared, require_control};
use crate::{
    api::{Api, For},
    failure::Failure,
    routes::rig::figures,
    view::{DONE, Done},
};

/// Optics, as `optics.toml` has them: `lens`, `sensor`, `focus`, `psf`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Optics {
    /// The tables of the file.
    #[schemars(with = "Value")]
    pub optics: OpticsFile,
}

/// Values as typed by the user.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Typed {
    /// The tables of an optics file.
    #[schemars(with = "Value")]
    pub optics: OpticsFile,
    /// Readings of a micrometer, `far_mm` (m1) and `near_mm` (m2), where the rig is turned by hand.
    #[serde(default)]
    #[schemars(with = "Value")]
    pub readings: Readings,
}

/// Working range and travel of a lens.
#[derive(Serialize, JsonSchema)]
pub struct Calculated {
    /// Working range, blur, resolution, readings.
    pub figures: Value,
}

pub fn routes(api: Api) -> Api {
    api.get::<Optics, _, _>("/api/optics", "The optics that captures are taken with.", read)
        .put::<Optics, Done, _, _>(
            "/api/optics",
            For::Control,
            "Takes captures with other optics from now on.",
            write,
        )
        .post::<Typed, Calculated, _, _>(
            "/api/optics/calculate",
            For::All,
            "Working range, travel, blur and readings of optics; nothing is changed.",
            calculate,
        )
}

async fn read(State(app): Shared) -> Result<Json<Optics>, Failure> {
    let given = GivenOptics::read(&app.optics_file())?;
    Ok(Json(Optics { optics: OpticsFile::from(given.optics) }))
}

async fn write(
    State(app): Shared,
    headers: HeaderMap,
    Body(given): Body<Optics>,
) -> Result<Json<Done>, Failure> {
    require_control(&app, &headers)?;
    // Invalid values are refused before the file changes.
    let checked = lens_table::calculate(&given.optics, Readings::default())?.optics;
    let text = toml::to_string(&checked).map_err(WorkflowError::from)?;
    write_file(&app.optics_file(), text.as_bytes()).map_err(WorkflowError::from)?;
    app.change(|state| state.optics += 1);
    app.interrupt_live();
    Ok(Json(DONE))
}

async fn calculate(Body(typed): Body<Typed>) -> Result<Json<Calculated>, Failure> {
    let calculated = lens_table::calculate(&typed.optics, typed.readings)?;
    Ok(Json(Calculated { figures: figures(calculated)? }))
}
