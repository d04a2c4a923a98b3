//! The optics and quantities derived from them.

use axum::{Json, extract::State, http::Method};
use farnear_depth::optics::{LightSection, OpticsFile};
use farnear_files::staging::write_file;
use farnear_workflows::{
    WorkflowError,
    lens_table::{self, Readings},
    optics::GivenOptics,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Body, Shared};
use crate::{
    api::{Api, For},
    failure::Failure,
    routes::rig::figures,
    view::{DONE, Done},
};

/// Optics, as `optics.toml` has them: `lens`, `sensor`, `focus`, `psf`, `light`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Optics {
    /// The tables of the file. Without `light`, the session's `[light]` stays.
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
        .change::<Optics, Done, _, _>(
            "/api/optics",
            Method::PUT,
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
    let light = light_of(&given);
    Ok(Json(Optics { optics: OpticsFile { light, ..OpticsFile::from(given.optics) } }))
}

/// `[light]` as the file has it: [`GivenOptics::light`] is in steps of the outputs, and absent if it is off.
fn light_of(given: &GivenOptics) -> Option<LightSection> {
    given.table.get("light").and_then(|light| light.clone().try_into().ok())
}

async fn write(State(app): Shared, Body(given): Body<Optics>) -> Result<Json<Done>, Failure> {
    let file = app.optics_file();
    // Invalid values are refused before the file changes.
    let checked = lens_table::calculate(&given.optics, Readings::default())?.optics;
    // A lens that was calculated or calibrated has no light.
    let light = given.optics.light.or_else(|| light_of(&GivenOptics::read(&file).ok()?));
    let text = toml::to_string(&OpticsFile { light, ..checked }).map_err(WorkflowError::from)?;
    GivenOptics::parse(&text, &file)?;
    write_file(&file, text.as_bytes()).map_err(WorkflowError::from)?;
    app.change(|state| state.optics += 1);
    app.interrupt_live();
    Ok(Json(DONE))
}

async fn calculate(Body(typed): Body<Typed>) -> Result<Json<Calculated>, Failure> {
    let calculated = lens_table::calculate(&typed.optics, typed.readings)?;
    Ok(Json(Calculated { figures: figures(calculated)? }))
}
