//! A far- and a near-focused image into a capture folder.

use std::path::PathBuf;

use farnear_capture::{
    camera::Image,
    pair::{Exposures, Pair, capture_pair},
    plan::SensorPair,
    record::{CaptureRecord, begin_folder, finish_folder, record_of},
};
use farnear_depth::prepare::CameraFrames;
use ndarray::Zip;
use serde::Serialize;

use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{camera_frames, context::Context, error::Result, optics::GivenOptics, parameters::within};

#[derive(Clone, Debug)]
pub struct PairSettings {
    pub rig: RigAddress,
    pub camera: CameraSettings,
    pub optics: PathBuf,
    /// Exposures of each image, which are averaged: 1 to [`AVERAGED_MAX`].
    pub averaged: u16,
    /// The folder of the camera's dark and flat frames ([`crate::camera_frames`]), which are taken off the images.
    pub frames: Option<PathBuf>,
    /// The new capture folder.
    pub out: PathBuf,
}

/// Most exposures that are averaged: beyond, drift counts more than noise.
pub const AVERAGED_MAX: u16 = 256;

/// What there is to say of a pair.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PairFigures {
    /// Board time for both settled moves and both images, without the exposures.
    pub pair_ms: f64,
    /// From the start of the far move until it was settled.
    pub far_settle_ms: f64,
    /// The same of the near move; 0 behind a half mirror, which has no such move.
    pub near_settle_ms: f64,
    /// Sensor distance by encoder and gauge at the far exposure.
    pub sensor_far_mm: f64,
    /// The same at the near exposure.
    pub sensor_near_mm: f64,
    pub width: usize,
    pub height: usize,
}

impl From<&Pair> for PairFigures {
    fn from(pair: &Pair) -> Self {
        let (height, width) = pair.far.image.pixels.dim();
        let ms = |us: u32| f64::from(us) / 1e3;
        Self {
            pair_ms: pair.moving_us() as f64 / 1e3,
            far_settle_ms: ms(pair.far.record.settle.0),
            near_settle_ms: pair.further_mm.map_or(ms(pair.near.record.settle.0), |_| 0.0),
            sensor_far_mm: pair.far.sensor_measured_mm,
            sensor_near_mm: pair.near.sensor_measured_mm,
            width,
            height,
        }
    }
}

/// Captures a pair: homes where needed, brings the stage near, exposes both by piezo. The folder appears when everything
/// is in it: far.png, near.png and capture.toml.
pub fn capture(settings: &PairSettings, context: &Context<'_>) -> Result<PairFigures> {
    capture_seen(settings, context, |_| ())
}

/// The same; `on_pair` receives the pair before anything is written.
pub fn capture_seen(
    settings: &PairSettings,
    context: &Context<'_>,
    on_pair: impl FnOnce(&Pair),
) -> Result<PairFigures> {
    let optics = GivenOptics::read(&settings.optics)?;
    within("average", settings.averaged, &(1..=AVERAGED_MAX), "exposures")?;
    let frames = settings.frames.as_deref().map(camera_frames::read).transpose()?;
    let folder = begin_folder(&settings.out)?;
    let mut rig = settings.camera.connect(&settings.rig, Some(optics.for_emulation()), context)?;
    let (mut pair, mut record) =
        take_averaged(&mut rig, &optics, &settings.camera, settings.averaged, context)?;
    if let Some(frames) = &frames {
        for taken in [&mut pair.far, &mut pair.near] {
            taken.image = corrected(&taken.image, frames)?;
        }
        record.camera.bits = pair.far.image.bits;
        record.camera.corrected = true;
    }
    on_pair(&pair);
    finish_folder(folder, &pair, &record)?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(PairFigures::from(&pair))
}

/// The image without the camera's faults, in 16 bits: what is not saturated stays below white, and what is darker than the dark frame
/// is black.
fn corrected(image: &Image, frames: &CameraFrames) -> Result<Image> {
    const WHITE: f32 = 65_535.0;
    let white = ((1_u32 << image.bits.min(16)) - 1) as u16;
    let grey = image.pixels.mapv(|code| f32::from(code) / f32::from(white));
    let seen = frames.correct(grey.view())?;
    let pixels = Zip::from(&image.pixels).and(&seen).map_collect(|raw, seen| match *raw >= white {
        true => u16::MAX,
        false => (seen * WHITE).round().clamp(0.0, WHITE - 1.0) as u16,
    });
    Ok(Image { pixels, bits: 16 })
}

/// Captures a pair with an open rig and camera.
pub fn take(
    equipped: &mut EquippedRig,
    optics: &GivenOptics,
    settings: &CameraSettings,
    context: &Context<'_>,
) -> Result<(Pair, CaptureRecord)> {
    take_averaged(equipped, optics, settings, 1, context)
}

/// As [`take`], with each image the mean of this many exposures.
fn take_averaged(
    equipped: &mut EquippedRig,
    optics: &GivenOptics,
    settings: &CameraSettings,
    averaged: u16,
    context: &Context<'_>,
) -> Result<(Pair, CaptureRecord)> {
    let range = optics.optics.working_range();
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures = Exposures {
        exposure: settings.exposure,
        image_wait: settings.image_wait,
        averaged,
        ..Exposures::default()
    };
    let EquippedRig { camera, rig } = equipped;
    let say = &mut |what: &str| context.info(what);
    let pair = capture_pair(&rig.client, camera.as_mut(), &sensor, &exposures, say)?;
    let record = noted(&pair, equipped, optics, settings, averaged);
    Ok((pair, record))
}

/// The record of a pair, with its settings.
pub(super) fn noted(
    pair: &Pair,
    equipped: &EquippedRig,
    optics: &GivenOptics,
    settings: &CameraSettings,
    averaged: u16,
) -> CaptureRecord {
    let circumstances = equipped.circumstances(optics.optics.psf(), optics.table.clone());
    let mut record = record_of(pair, &equipped.rig.client, circumstances);
    record.camera.averaged = (averaged > 1).then_some(averaged);
    record.camera.settings =
        settings.settings.iter().map(|setting| (setting.name().to_owned(), setting.value())).collect();
    record
}
