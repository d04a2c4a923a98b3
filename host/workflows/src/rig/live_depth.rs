//! Live depth: pair after pair by the piezo, each with its map, until somebody wishes it to end.

use std::{path::PathBuf, time::Instant};

use farnear_capture::{
    camera::Image,
    expose::expose,
    plan::{SensorPair, coarse_for, fine_for},
    ready::{base_nm, base_when_homed_nm, ensure_homed},
    sequence::ShotDefaults,
};
use farnear_depth::pipeline::{DepthMap, Processor, Settings};
use farnear_protocol::message::{Axis, Shot};
use ndarray::Array2;

use super::{RigAddress, camera::CameraSettings, camera::EquippedRig};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    operators,
    optics::GivenOptics,
};

/// Pairs of one program: the board takes up to 64 shots, and one program costs one arming.
const PAIRS: usize = 8;

/// What is looked at, and how depth is computed.
#[derive(Clone, PartialEq, Debug)]
pub struct LiveDepthSettings {
    /// The rig.
    pub rig: RigAddress,
    /// Its camera.
    pub camera: CameraSettings,
    /// The optics file.
    pub optics: PathBuf,
    /// Windows, filling and threads.
    pub computation: Settings,
}

/// A pair and its depth.
pub struct LiveDepth<'a> {
    /// The far-focused image.
    pub far: &'a Image,
    /// Its depth, confidence and warnings.
    pub map: &'a DepthMap,
    /// Board time from the start of the far exposure to the end of the near one, in ms.
    pub pair_ms: f64,
    /// From the arrival of the near image to the finished map, in ms of this computer's clock.
    pub latency_ms: f64,
}

/// Gives pair after pair with its depth to `on_depth` until it or the context wants no more. Homes where needed. The rig is
/// stopped before this returns.
///
/// # Errors
/// Optics, operators, camera, rig, computation; [`WorkflowError::Cancelled`] at the wished end; what `on_depth` gives.
pub fn watch(
    settings: &LiveDepthSettings,
    context: &Context<'_>,
    mut on_depth: impl FnMut(LiveDepth<'_>) -> Result<()>,
) -> Result<()> {
    let optics = GivenOptics::read(&settings.optics)?;
    let designed = operators::find(None, &optics.optics)?;
    let mut processor = Processor::new(&designed, &optics.optics, &settings.computation)?;
    let mut equipped = settings.camera.connect(&settings.rig, Some(optics.for_emulation()), context)?;
    let shots = ready(&equipped, &optics, settings, context)?;
    let EquippedRig { camera, rig } = &mut equipped;
    loop {
        let mut far: Option<(Image, u64)> = None;
        expose(&rig.client, camera.as_mut(), &shots, settings.camera.image_wait, |record, image| {
            context.cancel.check("watching depth")?;
            let Some((far_image, begin_us)) = far.take() else {
                far = Some((image, record.strobe_start.0));
                return Ok(());
            };
            let arrived = Instant::now();
            let map = processor.run(grey(&far_image).view(), grey(&image).view())?;
            let pair_ms = record.strobe_end.0.saturating_sub(begin_us) as f64 / 1e3;
            let latency_ms = arrived.elapsed().as_secs_f64() * 1e3;
            on_depth(LiveDepth { far: &far_image, map, pair_ms, latency_ms })
        })
        .map_err(|error: WorkflowError| error)?;
    }
}

/// Brings the stage where the piezo reaches both focus settings, and gives the program.
fn ready(
    equipped: &EquippedRig,
    optics: &GivenOptics,
    settings: &LiveDepthSettings,
    context: &Context<'_>,
) -> Result<Vec<Shot>> {
    let client = &equipped.rig.client;
    let limits = client.hello().limits;
    let range = optics.optics.working_range();
    let pair = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    coarse_for(&pair, base_when_homed_nm(client, &client.status()?), &limits)?;
    ensure_homed(client, &mut |what| context.say(what))?;
    let base = base_nm(client, &client.status()?);
    let coarse = client.move_to(Axis::SensorCoarse, coarse_for(&pair, base, &limits)?)?;
    let defaults = ShotDefaults { exposure: settings.camera.exposure, ..ShotDefaults::default() };
    let shot = |sensor_mm| -> Result<Shot> {
        Ok(defaults.shot(Axis::SensorFine, fine_for(sensor_mm, base, coarse.measured, &limits)?))
    };
    let both = [shot(pair.far_mm)?, shot(pair.near_mm)?];
    let pairs = PAIRS.min(usize::from(limits.shots_max) / 2).max(1);
    Ok(both.iter().copied().cycle().take(2 * pairs).collect())
}

/// Grey values from 0 to 1.
pub(super) fn grey(image: &Image) -> Array2<f32> {
    let largest = f32::from(((1u32 << image.bits.min(16)) - 1) as u16);
    image.pixels.mapv(|code| f32::from(code) / largest)
}
