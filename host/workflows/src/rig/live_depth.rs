//! Live depth: pairs by the piezo, each with its map, until cancelled.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use farnear_capture::{
    camera::Image,
    continuous::{Continuous, Cycles, Frame, Outcome, Pace},
    pair::{Exposures, reach},
    plan::SensorPair,
};
use farnear_depth::{
    measure::{DepthMethod, MeasureError, MeasureSettings, Measurement},
    optics::Optics,
    pipeline::RunError,
    prepare::{PrepareError, PrepareSettings},
    stream::Stream,
};
use farnear_protocol::{Micros, Settle, message::Axis};
use ndarray::Array2;

use super::{RigAddress, camera::CameraSettings, camera::EquippedRig};
use crate::{
    context::Context,
    depth::DepthRequest,
    error::Result,
    optics::{GivenOptics, another_size},
};

/// Longest time for which pairs may be skipped in favour of newer ones.
const PASSED_OVER: Duration = Duration::from_millis(100);

#[derive(Clone, PartialEq, Debug)]
pub struct LiveDepthSettings {
    pub rig: RigAddress,
    pub camera: CameraSettings,
    pub optics: PathBuf,
}

pub struct LiveDepth<'a> {
    pub far: &'a Image,
    pub near: &'a Image,
    pub found: &'a Measurement,
    /// Board time from the start of the far exposure to the end of the near one.
    pub pair_ms: f64,
    /// From the arrival of the near image to the finished map, by the host's clock.
    pub latency_ms: f64,
}

/// Depth of grey values (0 to 1) with the default settings for a capture's files.
pub fn stream(optics: &Optics) -> Result<Stream> {
    let usual = DepthRequest::default().measure(DepthMethod::Whitened);
    let prepare = PrepareSettings { limits: Some([0.0, 1.0]), ..usual.prepare };
    Ok(Stream::new(optics, &MeasureSettings { prepare, ..usual })?)
}

/// Depth of the next pair; `None` if the scene changed between its exposures, as it may before a running camera, and with a
/// warning if an image is constant, as under a covered lens.
pub(super) fn measure(
    stream: &mut Stream,
    pair: [Array2<f32>; 2],
    context: &Context<'_>,
) -> Result<Option<Measurement>> {
    match stream.measure(pair) {
        Ok(found) => Ok(Some(found)),
        Err(MeasureError::Prepare(PrepareError::Unrelated { .. })) => Ok(None),
        Err(
            MeasureError::Run(error @ RunError::Constant { .. })
            | MeasureError::Prepare(PrepareError::Pair(error @ RunError::Constant { .. })),
        ) => {
            context.progress.warn(&error.to_string());
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Passes each pair to `on_depth` until it or the context stops. Homes if needed; stops the rig at the end.
pub fn watch(
    settings: &LiveDepthSettings,
    context: &Context<'_>,
    mut on_depth: impl FnMut(LiveDepth<'_>) -> Result<()>,
) -> Result<()> {
    let optics = GivenOptics::read(&settings.optics)?;
    let mut depths = stream(&optics.optics)?;
    let mut equipped = settings.camera.connect(&settings.rig, Some(&optics), context)?;
    let range = optics.optics.working_range();
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures = Exposures {
        exposure: settings.camera.exposure,
        settle: Settle::of_shot(Axis::SensorFine),
        ..Exposures::default()
    };
    let EquippedRig { camera, rig } = &mut equipped;
    let shots = reach(&rig.client, &sensor, &exposures, &mut |what| context.info(what))?.shots;
    let pace = Pace { period: Micros(0), exposures: 0 };
    let wait = settings.camera.image_wait;
    let mut stream = Continuous::start(&rig.client, camera.as_mut(), &shots, pace, wait)?;
    let mut cycles = Cycles::of(&shots);
    let mut shown: Option<Instant> = None;
    // Time spent waiting for the camera since then.
    let mut waited = Duration::ZERO;
    loop {
        let asked = Instant::now();
        let Some(outcome) = stream.outcome()? else { break };
        waited += asked.elapsed();
        context.cancel.check("watching depth")?;
        let Outcome::Taken(frame) = outcome else { continue };
        let Some([far, near]) = cycles.push(*frame).and_then(|cycle| <[Frame; 2]>::try_from(cycle).ok())
        else {
            continue;
        };
        // Skip old pairs if this computer is slower than rig and camera, but show some however slow it is.
        let skips = |shown: Instant| shown.elapsed() < PASSED_OVER && waited < shown.elapsed() / 10;
        if stream.waiting()? >= shots.len() && shown.is_some_and(skips) {
            continue;
        }
        if shown.is_none()
            && let Some(doubt) = another_size(&optics.optics, far.image.pixels.dim())
        {
            context.progress.warn(&doubt.to_string());
        }
        let arrived = Instant::now();
        (shown, waited) = (Some(arrived), Duration::ZERO);
        depths.set_coding(0.5 * (far.image.coding_variance + near.image.coding_variance));
        let Some(found) = measure(&mut depths, [&far, &near].map(|frame| frame.image.grey()), context)?
        else {
            continue;
        };
        let pair_us = near.record.strobe_end.0.saturating_sub(far.record.strobe_start.0);
        let latency_ms = arrived.elapsed().as_secs_f64() * 1e3;
        on_depth(LiveDepth {
            far: &far.image,
            near: &near.image,
            found: &found,
            pair_ms: pair_us as f64 / 1e3,
            latency_ms,
        })?;
    }
    Ok(())
}
