use std::path::PathBuf;

use farnear_capture::{
    camera::Image,
    expose::unlit_note,
    pair::{Exposures, Pair, capture_pair},
    plan::SensorPair,
    record::{CaptureRecord, begin_folder, finish_folder, record_of},
};
use farnear_depth::{focus_measure::FocusMeasure, prepare::CameraFrames};
use ndarray::Zip;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::half_mirror;
use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{
    camera_frames,
    context::Context,
    error::{Result, WorkflowError},
    optics::GivenOptics,
    parameters::within,
    picture,
    request::{PathKind, Request},
};

/// Capture a far- and a near-focused image: home if needed, move the stage near, expose both by piezo.
///
/// The folder appears when it is complete: far.png, near.png and capture.toml.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "\
Example: farnear rig capture --port /dev/ttyACM0 --camera folder:incoming/ --optics optics.toml --out pair1/
         farnear rig capture --port /dev/ttyACM0 --camera genicam: --set gain=2 --average 8 --optics optics.toml --out pair2/
         farnear rig capture --port /dev/ttyACM0 --camera genicam:A --half-mirror --second-camera genicam:B --optics optics.toml --out pair3/")
)]
#[serde(default)]
pub struct CaptureRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Exposures averaged for each image, 1 to 256: noise falls with the root of their number.
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", default_value_t = Self::default().average))]
    pub average: u16,
    /// Find the exposure time at which the brightest pixels have 80 % of white, beginning with --exposure-us.
    #[cfg_attr(feature = "clap", arg(long, conflicts_with = "half_mirror"))]
    pub auto_exposure: bool,
    /// Take each image also without the board's light and subtract it, so that only that light counts. Needs --light, a scene that
    /// does not move, and a steady room light: with mains lamps expose for multiples of 10 ms (8.333 ms at 60 Hz).
    #[cfg_attr(feature = "clap", arg(long, conflicts_with = "half_mirror"))]
    pub subtract_ambient: bool,
    /// Subtract the camera's dark and flat frames from both images: a folder of `farnear calibrate camera`. Do not give it to
    /// `farnear depth` again.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub camera_frames: Option<PathBuf>,
    /// Take both images by one exposure: a half mirror is behind the lens, and a second camera in its other path takes the near
    /// image (docs/rig.md). The stage goes to the far place. The emulated rig has a half mirror then.
    #[cfg_attr(feature = "clap", arg(long))]
    pub half_mirror: bool,
    /// The second camera, named as the first; exposure, wait and --set are those of both.
    #[cfg_attr(feature = "clap", arg(long, value_name = "CAMERA", requires = "half_mirror"))]
    pub second_camera: Option<String>,
    /// Distance of the second camera's sensor from the lens less that of the first, in micrometres [default: as the optics need].
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM", requires = "half_mirror"))]
    pub second_further_um: Option<f64>,
    /// Mirror the second camera's picture, left to right: it is in the reflected path and does not do so itself (ReverseX).
    #[cfg_attr(feature = "clap", arg(long, requires = "half_mirror"))]
    pub second_mirrored: bool,
    /// The new capture folder.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Default for CaptureRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            camera: CameraSettings::default(),
            optics: PathBuf::new(),
            average: 1,
            auto_exposure: false,
            subtract_ambient: false,
            camera_frames: None,
            half_mirror: false,
            second_camera: None,
            second_further_um: None,
            second_mirrored: false,
            out: PathBuf::new(),
        }
    }
}

impl Request for CaptureRequest {
    const NAME: &'static str = "rig capture";
    const REQUIRED: &'static [&'static str] = &["optics", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("camera_frames", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = PairFigures;

    fn check(&self) -> Result<()> {
        if let Some(frames) = self.camera_frames.as_ref().filter(|_| self.subtract_ambient) {
            let expected = "subtracting the ambient light subtracts the dark signal, too: give one of both";
            return Err(WorkflowError::parameter("camera-frames", frames.display(), expected));
        }
        within("average", self.average, &(1..=AVERAGED_MAX), "exposures")
    }

    fn run(&self, context: &Context<'_>) -> Result<PairFigures> {
        capture(self, context)
    }
}

crate::request::camera_request!(CaptureRequest);

/// Most exposures to average: beyond this, drift exceeds noise.
pub const AVERAGED_MAX: u16 = 256;

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PairFigures {
    /// Board time for both settled moves and both images, without the exposures.
    pub pair_ms: f64,
    /// From the start of the far move until it settled.
    pub far_settle_ms: f64,
    /// As `far_settle_ms`; 0 behind a half mirror, which has no near move.
    pub near_settle_ms: f64,
    /// Measured sensor distance (encoder and gauge) at the far exposure.
    pub sensor_far_mm: f64,
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

/// Homes if needed, exposes both images by piezo. The folder appears when complete. Checks everything before moving.
pub fn capture(settings: &CaptureRequest, context: &Context<'_>) -> Result<PairFigures> {
    if settings.half_mirror {
        return half_mirror::capture(settings, context);
    }
    capture_seen(settings, context, |_| ())
}

/// As [`capture`]; `on_pair` receives the pair before anything is written.
pub fn capture_seen(
    settings: &CaptureRequest,
    context: &Context<'_>,
    on_pair: impl FnOnce(&Pair),
) -> Result<PairFigures> {
    let optics = GivenOptics::read(&settings.optics)?;
    settings.check()?;
    if settings.subtract_ambient && settings.camera.light_with(Some(&optics)).is_none() {
        let expected = "expected light to switch: --light 100, or [light] in the optics file";
        return Err(WorkflowError::parameter("subtract-ambient", "true", expected));
    }
    let frames = settings.camera_frames.as_deref().map(camera_frames::read).transpose()?;
    let folder = begin_folder(&settings.out)?;
    let mut rig = settings.camera.connect(&settings.rig, Some(&optics), context)?;
    let exposures = Exposures {
        averaged: settings.average,
        auto: settings.auto_exposure,
        subtract_ambient: settings.subtract_ambient,
        ..Exposures::default()
    };
    let (mut pair, mut record) = take_by(&mut rig, &optics, &settings.camera, exposures, context)?;
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

/// In 16 bits: unsaturated pixels stay below white; pixels darker than the dark frame are black.
fn corrected(image: &Image, frames: &CameraFrames) -> Result<Image> {
    const WHITE: f32 = 65_535.0;
    let white = ((1_u32 << image.bits.min(16)) - 1) as u16;
    let grey = image.pixels.mapv(|code| f32::from(code) / f32::from(white));
    let seen = frames.correct(grey.view())?;
    let pixels = Zip::from(&image.pixels).and(&seen).map_collect(|raw, seen| match *raw >= white {
        true => u16::MAX,
        false => (seen * WHITE).round().clamp(0.0, WHITE - 1.0) as u16,
    });
    Ok(Image { pixels, bits: 16, coding_variance: image.coding_variance })
}

pub fn take(
    equipped: &mut EquippedRig,
    optics: &GivenOptics,
    settings: &CameraSettings,
    context: &Context<'_>,
) -> Result<(Pair, CaptureRecord)> {
    take_by(equipped, optics, settings, Exposures::default(), context)
}

/// As [`take`], by several exposures; their time is that of `settings`.
fn take_by(
    equipped: &mut EquippedRig,
    optics: &GivenOptics,
    settings: &CameraSettings,
    exposures: Exposures,
    context: &Context<'_>,
) -> Result<(Pair, CaptureRecord)> {
    let range = optics.optics.working_range();
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures = Exposures { exposure: settings.exposure, image_wait: settings.image_wait, ..exposures };
    let EquippedRig { camera, rig } = equipped;
    let say = &mut |what: &str| context.info(what);
    let pair = capture_pair(&rig.client, camera.as_mut(), &sensor, &exposures, say)?;
    let lit = settings.light_with(Some(optics));
    if let Some(doubt) = lit.and_then(|_| unlit(&pair)).or_else(|| doubt_of_light(&pair)) {
        context.progress.warn(&doubt);
    }
    warn_of_images(&pair, context);
    let mut record = noted(&pair, equipped, optics, settings, exposures.averaged);
    record.camera.ambient_subtracted = exposures.subtract_ambient;
    Ok((pair, record))
}

/// A lens that is not telecentric changes the brightness by about 1 % with its focus.
const BRIGHTNESS_RATIO_MAX: f64 = 1.03;

/// Warns of images that are unfit for depth.
pub(super) fn warn_of_images(pair: &Pair, context: &Context<'_>) {
    for (which, image) in [("far", &pair.far.image), ("near", &pair.near.image)] {
        for warning in picture::figures(image, FocusMeasure::Tenengrad).warnings {
            context.progress.warn(&format!("the {which} image: {warning}"));
        }
    }
}

/// Doubt about a pair whose exposures the board's light missed in part.
pub(super) fn unlit(pair: &Pair) -> Option<String> {
    [&pair.far, &pair.near].into_iter().find_map(|taken| unlit_note(&taken.record))
}

/// Doubt about a pair whose images differ in brightness.
fn doubt_of_light(pair: &Pair) -> Option<String> {
    let mean = |image: &Image| image.pixels.iter().map(|code| f64::from(*code)).sum::<f64>();
    let (far, near) = (mean(&pair.far.image), mean(&pair.near.image));
    let ratio = far.max(near) / far.min(near).max(1.0);
    (ratio > BRIGHTNESS_RATIO_MAX).then(|| {
        format!(
            "one image is {:.0} % brighter than the other, so the light changed: expose for multiples of 10 ms under mains lamps \
             (8.333 ms at 60 Hz), or keep daylight out",
            100.0 * (ratio - 1.0)
        )
    })
}

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
    record.camera.settings = settings.recorded_settings();
    record
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dark_signal_is_subtracted_once() {
        let frames = Some(PathBuf::from("frames"));
        let request =
            CaptureRequest { camera_frames: frames, subtract_ambient: true, ..CaptureRequest::default() };
        let error = request.check().unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("dark signal"), "{error}");
        assert!(CaptureRequest { subtract_ambient: false, ..request }.check().is_ok());
    }
}
