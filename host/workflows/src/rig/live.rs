//! Live image: repeats a program at the current piezo position until cancelled. Only the piezo is active: it
//! is held in place. A program lasts about a quarter of a second. A fast camera then needs few requests, and
//! a slow one queues no old images.

use std::time::{Duration, Instant};

use farnear_capture::{
    camera::{CameraError, Image},
    expose::{CaptureError, expose},
    sequence::ShotDefaults,
};
use farnear_protocol::message::{Axis, Shot, ShotRecord};

use super::{RigAddress, camera::CameraSettings};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

const PROGRAM: Duration = Duration::from_millis(250);
/// Consecutive programs without their first image after which the live image fails.
const LOST_MAX: u32 = 8;
const REPEATS_MAX: u16 = 100;

#[derive(Clone, PartialEq, Debug)]
pub struct LiveSettings {
    pub rig: RigAddress,
    pub camera: CameraSettings,
}

/// Passes each frame to `on_frame` until it or the context stops. Stops the rig before returning.
pub fn watch(
    settings: &LiveSettings,
    context: &Context<'_>,
    mut on_frame: impl FnMut(ShotRecord, Image) -> Result<()>,
) -> Result<()> {
    let mut equipped = settings.camera.connect(&settings.rig, None, context)?;
    let (client, camera) = (&equipped.rig.client, equipped.camera.as_mut());
    let (mut repeats, mut lost) = (1, 0);
    loop {
        context.cancel.check("watching the live image")?;
        let begin = Instant::now();
        let shot = [Shot { repeat: repeats, ..held(client.status()?.fine.asked.0, client, settings) }];
        let exposed = expose(client, camera, &shot, settings.camera.image_wait, |record, image| {
            context.cancel.check("watching the live image")?;
            lost = 0;
            on_frame(record, image)
        });
        match exposed {
            // The camera reports this loss without a time-out, so the next image may still come.
            Err(WorkflowError::Capture(CaptureError::Camera(
                error @ (CameraError::Skipped { .. } | CameraError::Incomplete { .. }),
            ))) if lost + 1 < LOST_MAX => {
                lost += 1;
                context.info(&format!("live image: {error}"));
            }
            exposed => exposed?,
        }
        repeats = next(repeats, begin.elapsed());
    }
}

/// A shot at the current piezo position, moved inside the limits if the piezo was never commanded.
fn held(fine_nm: i32, client: &farnear_capture::Client, settings: &LiveSettings) -> Shot {
    let limits = client.hello().limits;
    let target = farnear_protocol::Nanometres(fine_nm.clamp(limits.fine_min.0, limits.fine_max.0));
    let defaults = ShotDefaults { exposure: settings.camera.exposure, ..ShotDefaults::default() };
    defaults.shot(Axis::SensorFine, target)
}

/// Exposures of the next program, if the last one took `repeats` in `took`.
fn next(repeats: u16, took: Duration) -> u16 {
    let each_s = took.as_secs_f64() / f64::from(repeats.max(1));
    (PROGRAM.as_secs_f64() / each_s.max(1e-3)).clamp(1.0, f64::from(REPEATS_MAX)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_camera_is_asked_for_one_image_at_a_time() {
        assert_eq!(next(1, Duration::from_secs(3)), 1);
        assert_eq!(next(100, Duration::from_secs(50)), 1);
        assert_eq!(next(1, Duration::from_millis(25)), 10);
        assert_eq!(next(10, Duration::from_millis(100)), 25);
        assert_eq!(next(1, Duration::ZERO), 100);
    }
}
