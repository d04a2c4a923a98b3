//! A far- and a near-focused image into a capture folder.

use std::path::PathBuf;

use farnear_capture::{
    pair::{Exposures, Pair, capture_pair},
    plan::SensorPair,
    record::{CaptureRecord, begin_folder, finish_folder, record_of},
};
use serde::Serialize;

use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{context::Context, error::Result, optics::GivenOptics};

/// What is captured with, and where to.
#[derive(Clone, Debug)]
pub struct PairSettings {
    /// The rig.
    pub rig: RigAddress,
    /// Its camera.
    pub camera: CameraSettings,
    /// The optics file.
    pub optics: PathBuf,
    /// The new capture folder.
    pub out: PathBuf,
}

/// What there is to say of a pair.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PairFigures {
    /// Board time for both settled moves and both images, without the exposures.
    pub pair_ms: f64,
    /// From the start of the far move until it was settled.
    pub far_settle_ms: f64,
    /// The same of the near move.
    pub near_settle_ms: f64,
    /// Sensor distance by encoder and gauge at the far exposure.
    pub sensor_far_mm: f64,
    /// The same at the near exposure.
    pub sensor_near_mm: f64,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

impl From<&Pair> for PairFigures {
    fn from(pair: &Pair) -> Self {
        let (height, width) = pair.far.image.pixels.dim();
        let ms = |us: u32| f64::from(us) / 1e3;
        Self {
            pair_ms: pair.moving_us() as f64 / 1e3,
            far_settle_ms: ms(pair.far.record.settle.0),
            near_settle_ms: ms(pair.near.record.settle.0),
            sensor_far_mm: pair.far.sensor_measured_mm,
            sensor_near_mm: pair.near.sensor_measured_mm,
            width,
            height,
        }
    }
}

/// Captures a pair: homes where needed, brings the stage near, exposes both by piezo. The folder appears when everything
/// is in it: far.png, near.png and capture.toml.
///
/// # Errors
/// Optics, folder, camera, rig: in this order, so that nothing moves where the result could not be kept.
pub fn capture(settings: &PairSettings, context: &Context<'_>) -> Result<PairFigures> {
    let optics = GivenOptics::read(&settings.optics)?;
    let folder = begin_folder(&settings.out)?;
    let mut rig = settings.camera.connect(&settings.rig, Some(optics.for_emulation()), context)?;
    let (pair, record) = take(&mut rig, &optics, &settings.camera, context)?;
    finish_folder(folder, &pair, &record)?;
    context.say(&format!("wrote {}", settings.out.display()));
    Ok(PairFigures::from(&pair))
}

/// Captures a pair with what is open already.
///
/// # Errors
/// [`crate::WorkflowError::Capture`].
pub fn take(
    equipped: &mut EquippedRig,
    optics: &GivenOptics,
    settings: &CameraSettings,
    context: &Context<'_>,
) -> Result<(Pair, CaptureRecord)> {
    let range = optics.optics.working_range();
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures =
        Exposures { exposure: settings.exposure, image_wait: settings.image_wait, ..Exposures::default() };
    let EquippedRig { camera, rig } = equipped;
    let say = &mut |what: &str| context.say(what);
    let pair = capture_pair(&rig.client, camera.as_mut(), &sensor, &exposures, say)?;
    let circumstances = equipped.circumstances(optics.optics.psf(), optics.table.clone());
    let record = record_of(&pair, &equipped.rig.client, circumstances);
    Ok((pair, record))
}
