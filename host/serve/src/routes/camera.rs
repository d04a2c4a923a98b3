use std::str::FromStr;

use axum::{Json, extract::State};
use farnear_capture::camera::Setting;
use farnear_workflows::{Context, camera, rig::RigAddress};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Body, Shared};
use crate::{
    api::{Api, For},
    app::App,
    failure::Failure,
    job_queue::Task,
    routes::rig::{begin, connected},
    view::Begun,
};

/// Camera settings; absent ones stay unchanged.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraRequest {
    /// As on the command line: `gain=2`, `region=0,0,640,480`.
    #[serde(default)]
    pub set: Vec<String>,
}

pub fn routes(api: Api) -> Api {
    api.post::<CameraRequest, Begun, _, _>(
        "/api/camera",
        For::Control,
        "Sets something on the camera, for everything that looks through it from now on; the job's result has all that can be set, with its range.",
        set,
    )
}

async fn set(State(app): Shared, Body(request): Body<CameraRequest>) -> Result<Json<Begun>, Failure> {
    let wished: Result<Vec<_>, _> = request.set.iter().map(|text| Setting::from_str(text)).collect();
    let wished = wished.map_err(Failure::bad_request)?;
    let alone = app.has_camera_alone();
    let rig = if alone { None } else { Some(RigAddress::Open(connected(&app)?)) };
    let mut camera = app.camera();
    for setting in wished {
        camera.settings.retain(|other| other.name() != setting.name());
        camera.settings.push(setting);
    }
    let work = move |app: &App, context: &Context<'_>| {
        let found = match rig {
            Some(rig) => camera::show(camera.connect(&rig, None, context)?.camera.as_mut())?,
            None => camera::show(camera::open(&camera.address, &camera.settings)?.as_mut())?,
        };
        // A refused setting is not tried again at the next picture.
        app.set_camera(camera.settings);
        Ok(found)
    };
    begin(&app, Task::new("camera", "Set up the camera", work))
}
