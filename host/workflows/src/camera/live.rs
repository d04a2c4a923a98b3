//! Live figures of a camera: frame rate, focus, brightness, saturation.

use std::time::{Duration, Instant};

use farnear_capture::camera::{Camera, CameraError, Frame, Image, Setting};
use farnear_depth::focus_measure::FocusMeasure;
use farnear_protocol::Micros;
use serde::Serialize;

use super::CameraChoice;
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
};

const SLICE: Duration = Duration::from_millis(100);
/// Consecutive damaged frames after which a view fails: a camera may begin with some.
const DAMAGED_MAX: u32 = 8;

#[derive(Clone, PartialEq, Debug)]
pub struct LiveSettings {
    pub camera: CameraChoice,
    pub measure: FocusMeasure,
    pub every: Duration,
    /// End after this time; without it, when cancelled.
    pub seconds: Option<f64>,
}

/// Figures of the last image of an interval.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct LiveFigures {
    pub frames_per_s: f64,
    /// `None` for a dark image or one smaller than 8x8 px.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus: Option<f64>,
    pub mean_percent: f64,
    pub saturated_percent: f64,
    pub width: usize,
    pub height: usize,
    /// Significant bits of a pixel.
    pub bits: u8,
}

/// Reports figures (or a lack of images) at intervals until the time is up or cancelled (no error); returns the image count.
pub fn live(
    settings: &LiveSettings,
    line: &mut dyn FnMut(&LiveFigures) -> std::io::Result<()>,
    context: &Context<'_>,
) -> Result<usize> {
    if let Some(seconds) = settings.seconds.filter(|seconds| !(0.0..1e9).contains(seconds)) {
        return Err(WorkflowError::parameter("seconds", seconds, "expected a positive time"));
    }
    let mut camera = Watched::new(settings.camera.open()?)?;
    let begin = Instant::now();
    let until = settings.seconds.map(|seconds| begin + Duration::from_secs_f64(seconds));
    let (mut all, mut since, mut frames, mut last) = (0, begin, 0_usize, None);
    while until.is_none_or(|until| Instant::now() < until) && !context.cancel.is_cancelled() {
        if let Some(frame) = camera.newest(context)? {
            (frames, last) = (frames + 1, Some(frame.image));
        }
        let passed = since.elapsed();
        if passed < settings.every {
            continue;
        }
        match last.take() {
            Some(image) => {
                let rate = frames as f64 / passed.as_secs_f64();
                line(&figures(&image, settings.measure, rate))
                    .map_err(|source| WorkflowError::Sink { source })?;
            }
            None => context.info("no picture came"),
        }
        (all, since, frames) = (all + frames, Instant::now(), 0);
    }
    Ok(all + frames)
}

/// Passes images to `on_frame` until it or the context stops. Sets the exposure if the camera supports it.
pub fn watch(
    mut camera: Box<dyn Camera>,
    exposure: Micros,
    context: &Context<'_>,
    mut on_frame: impl FnMut(Frame) -> Result<()>,
) -> Result<()> {
    let exposure = Setting::ExposureUs(f64::from(exposure.0));
    if camera.controls()?.iter().any(|control| control.name == exposure.name()) {
        camera.set(&exposure)?;
    }
    let mut camera = Watched::new(camera)?;
    loop {
        context.cancel.check("looking through the camera")?;
        if let Some(frame) = camera.newest(context)? {
            on_frame(frame)?;
        }
    }
}

/// A camera in live view, which may lose frames.
struct Watched {
    camera: Box<dyn Camera>,
    /// Consecutive damaged frames.
    damaged: u32,
}

impl Watched {
    fn new(mut camera: Box<dyn Camera>) -> Result<Self> {
        camera.watch()?;
        Ok(Self { camera, damaged: 0 })
    }

    /// Waits at most [`SLICE`].
    fn newest(&mut self, context: &Context<'_>) -> Result<Option<Frame>> {
        match self.camera.newest(SLICE) {
            Err(error @ CameraError::Incomplete { .. }) if self.damaged + 1 < DAMAGED_MAX => {
                self.damaged += 1;
                context.info(&format!("live image: {error}"));
                Ok(None)
            }
            Ok(Some(frame)) => {
                self.damaged = 0;
                Ok(Some(frame))
            }
            other => Ok(other?),
        }
    }
}

fn figures(image: &Image, measure: FocusMeasure, frames_per_s: f64) -> LiveFigures {
    let full = u16::MAX >> (16 - u32::from(image.bits.clamp(1, 16)));
    let count = image.pixels.len().max(1) as f64;
    let sum: f64 = image.pixels.iter().map(|value| f64::from(*value)).sum();
    let saturated = image.pixels.iter().filter(|value| **value >= full).count() as f64;
    let (height, width) = image.pixels.dim();
    let scaled = image.pixels.mapv(|value| f32::from(value) / f32::from(full));
    LiveFigures {
        frames_per_s: rounded(frames_per_s, 2),
        focus: measure.of(scaled.view()).ok().map(|focus| rounded(focus, 6)),
        mean_percent: rounded(100.0 * sum / count / f64::from(full), 2),
        saturated_percent: rounded(100.0 * saturated / count, 3),
        width,
        height,
        bits: image.bits,
    }
}

#[cfg(test)]
mod tests {
    use farnear_capture::camera::Stamp;
    use farnear_protocol::message::{ShotRecord, TriggerMode};
    use ndarray::Array2;

    use super::*;

    /// Frames that are whole (`true`) or damaged; it waits after the last.
    struct Damaged(std::vec::IntoIter<bool>);

    impl Camera for Damaged {
        fn kind(&self) -> &'static str {
            "damaged"
        }

        fn arm(&mut self, _: TriggerMode, _: Micros) -> std::result::Result<(), CameraError> {
            Ok(())
        }

        fn trigger(&mut self, _: u32, _: Micros) -> std::result::Result<(), CameraError> {
            Ok(())
        }

        fn image(&mut self, _: &ShotRecord, _: Duration) -> std::result::Result<Image, CameraError> {
            Ok(Image::new(Array2::zeros((2, 2)), 8))
        }

        fn watch(&mut self) -> std::result::Result<(), CameraError> {
            Ok(())
        }

        fn newest(&mut self, _: Duration) -> std::result::Result<Option<Frame>, CameraError> {
            match self.0.next() {
                Some(true) => {
                    let image = Image::new(Array2::zeros((2, 2)), 8);
                    Ok(Some(Frame { image, stamp: Stamp::default() }))
                }
                Some(false) => Err(CameraError::Incomplete {
                    camera: "damaged".into(),
                    frame: 0,
                    reason: "packets were lost".into(),
                }),
                None => Ok(None),
            }
        }
    }

    #[test]
    fn live_view_tolerates_seven_consecutive_damaged_frames() {
        let seven = [false; DAMAGED_MAX as usize - 1];
        let frames = [&seven[..], &[true], &seven, &[true, false], &seven, &[true]].concat();
        let mut whole = 0;
        let camera = Box::new(Damaged(frames.into_iter()));
        let ended = watch(camera, Micros(5_000), &Context::unattended(), |_| {
            whole += 1;
            Ok(())
        });
        let error = ended.unwrap_err().to_string();
        assert!(whole == 2 && error.contains("packets were lost"), "{whole}: {error}");
    }

    #[test]
    fn a_pictures_figures_follow_from_its_pixels() {
        let mut pixels = Array2::from_elem((10, 20), 1000_u16);
        pixels.row_mut(0).fill(4095);
        let seen = figures(&Image::new(pixels, 12), FocusMeasure::Tenengrad, 24.996);
        assert_eq!((seen.frames_per_s, seen.saturated_percent), (25.0, 10.0));
        // (20 * 4095 + 180 * 1000) / 200 / 4095
        assert_eq!(seen.mean_percent, 31.98);
        assert!(seen.focus.is_some_and(|focus| focus > 0.0), "{seen:?}");
        let dark = figures(&Image::new(Array2::zeros((10, 20)), 8), FocusMeasure::Tenengrad, 1.0);
        assert_eq!((dark.focus, dark.mean_percent), (None, 0.0));
    }
}
