//! The live image: a program that is repeated where the piezo stands, frame after frame, until somebody wishes it to end.
//!
//! Nothing moves but the piezo, which is held where it is. Cost on the line: one program of [`REPEATS`] exposures, and an event
//! for each of them.

use farnear_capture::{camera::Image, expose::expose, sequence::ShotDefaults};
use farnear_protocol::message::{Axis, Shot, ShotRecord};

use super::{RigAddress, camera::CameraSettings};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// Exposures of one program: enough that arming it costs nothing, few enough that a setting somebody else changed is soon seen.
const REPEATS: u16 = 100;

/// What is looked at.
#[derive(Clone, PartialEq, Debug)]
pub struct LiveSettings {
    /// The rig.
    pub rig: RigAddress,
    /// Its camera.
    pub camera: CameraSettings,
}

/// Gives frame after frame to `on_frame` until it or the context wants no more. The rig is stopped before this returns.
///
/// # Errors
/// [`WorkflowError::Cancelled`] or the client's word for it at the wished end; camera and rig; what `on_frame` gives.
pub fn watch(
    settings: &LiveSettings,
    context: &Context<'_>,
    mut on_frame: impl FnMut(ShotRecord, Image) -> Result<()>,
) -> Result<()> {
    let mut equipped = settings.camera.connect(&settings.rig, None, context)?;
    let (client, camera) = (&equipped.rig.client, equipped.camera.as_mut());
    loop {
        context.cancel.check("watching the live image")?;
        let shot = [held(client.status()?.fine.asked.0, client, settings)];
        expose(client, camera, &shot, settings.camera.image_wait, |record, image| {
            context.cancel.check("watching the live image")?;
            on_frame(record, image)
        })
        .map_err(|error: WorkflowError| error)?;
    }
}

/// A shot where the piezo stands; a piezo that was never sent anywhere may stand outside its limits.
fn held(fine_nm: i32, client: &farnear_capture::Client, settings: &LiveSettings) -> Shot {
    let limits = client.hello().limits;
    let target = farnear_protocol::Nanometres(fine_nm.clamp(limits.fine_min.0, limits.fine_max.0));
    let defaults =
        ShotDefaults { exposure: settings.camera.exposure, repeat: REPEATS, ..ShotDefaults::default() };
    defaults.shot(Axis::SensorFine, target)
}
