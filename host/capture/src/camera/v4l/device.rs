//! A streaming Video4Linux device with mapped buffers.

use std::{
    io,
    panic::catch_unwind,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use ::v4l::{
    Device, FourCC,
    buffer::{Flags, Metadata, Type},
    capability,
    control::{self, Value},
    io::{
        mmap::Stream,
        traits::{CaptureStream, Stream as _},
    },
    video::Capture,
};
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};

use super::{best_format, check_path, refused, unusable};
use crate::{
    camera::{
        Camera, CameraError, Control, Frame, Image, Range, Setting, Stamp, pairing::Pairing, pixels::Layout,
    },
    describe::trigger_name,
};

const BUFFERS: u32 = 4;
/// Flag of `poll` for a ready frame on every Linux.
const POLLIN: i16 = 1;

// linux/v4l2-controls.h.
const EXPOSURE_AUTO: u32 = 0x009a_0901;
const EXPOSURE_AUTO_MANUAL: i64 = 1;
const EXPOSURE_ABSOLUTE: u32 = 0x009a_0902; // in 100 us
const EXPOSURE_UNIT_US: f64 = 100.0;
const AUTOGAIN: u32 = 0x0098_0912;
const GAIN: u32 = 0x0098_0913;
const ANALOGUE_GAIN: u32 = 0x009e_0903;
const BLACK_LEVEL: u32 = 0x0098_090b;
const BRIGHTNESS: u32 = 0x0098_0900; // what webcams have for it

pub struct V4lCamera {
    path: PathBuf,
    device: Device,
    layout: Layout,
    width: usize,
    height: usize,
    stride: usize,
    /// Present while armed or watched.
    stream: Option<Stream<'static>>,
    pairing: Pairing,
}

impl V4lCamera {
    /// Opens e.g. `/dev/video0` with its best format at the driver's size.
    pub fn open(path: &Path) -> Result<Self, CameraError> {
        check_path(path)?;
        let failed = |error: io::Error| refused(path, &error);
        let device = Device::with_path(path).map_err(failed)?;
        let capabilities = device.query_caps().map_err(failed)?.capabilities;
        let needed = capability::Flags::VIDEO_CAPTURE | capability::Flags::STREAMING;
        if !capabilities.contains(needed) {
            return Err(unusable(
                path,
                format!("it does not capture pictures; its capabilities: {capabilities}"),
            ));
        }
        let offered: Vec<[u8; 4]> =
            device.enum_formats().map_err(failed)?.iter().map(|format| format.fourcc.repr).collect();
        let (name, layout) = best_format(path, &offered)?;
        let mut camera = Self {
            path: path.into(),
            device,
            layout,
            width: 0,
            height: 0,
            stride: 0,
            stream: None,
            pairing: Pairing::default(),
        };
        camera.choose(name, layout)?;
        Ok(camera)
    }

    fn failed(&self) -> impl Fn(io::Error) -> CameraError + '_ {
        |error| refused(&self.path, &error)
    }

    fn choose(&mut self, name: [u8; 4], layout: Layout) -> Result<(), CameraError> {
        self.stream = None; // a format cannot change under a stream
        let mut format = self.device.format().map_err(self.failed())?;
        format.fourcc = FourCC::new(&name);
        format.stride = 0;
        let format = self.device.set_format(&format).map_err(self.failed())?;
        if format.fourcc.repr != name {
            let (asked, got) = (FourCC::new(&name), format.fourcc);
            return Err(unusable(&self.path, format!("requested {asked}, got {got}")));
        }
        (self.width, self.height) = (format.width as usize, format.height as usize);
        (self.stride, self.layout) = (format.stride as usize, layout);
        Ok(())
    }

    /// Restarts the stream: old frames are dropped, the driver counts from 0.
    fn restart(&mut self) -> Result<(), CameraError> {
        self.stream = None;
        self.pairing.begin();
        let started = (|| {
            let mut stream = Stream::with_buffers(&self.device, Type::VideoCapture, BUFFERS)?;
            // Skips the first: `next` queues its previous buffer, initially the first.
            for index in 1..BUFFERS as usize {
                match CaptureStream::queue(&mut stream, index) {
                    // The driver may allocate fewer buffers.
                    Err(_) if index > 1 => break,
                    result => result?,
                }
            }
            stream.start()?;
            Ok(stream)
        })();
        self.stream = Some(started.map_err(self.failed())?);
        Ok(())
    }

    /// The frame that came too early, or the next one; `None` at the timeout.
    fn next(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        self.pairing.early().map_or_else(|| self.take(wait), |frame| Ok(Some(frame)))
    }

    /// The next frame; `None` at the timeout.
    fn take(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        let Some(stream) = &mut self.stream else { return Ok(None) };
        let failed = |error: io::Error| refused(&self.path, &error);
        // Polls before `next`, which would queue a buffer twice after its own timeout.
        let wait_ms = i32::try_from(wait.as_millis()).unwrap_or(i32::MAX);
        match self.device.handle().poll(POLLIN, wait_ms) {
            Ok(0) => return Ok(None),
            // A signal, such as Ctrl-C: the caller looks whether it is to end.
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return Ok(None),
            polled => polled.map_err(failed)?,
        };
        let (bytes, metadata) = stream.next().map_err(failed)?;
        let number = metadata.sequence;
        let incomplete = |reason: String| CameraError::Incomplete {
            camera: self.path.display().to_string(),
            frame: number.into(),
            reason,
        };
        if metadata.flags.contains(Flags::ERROR) {
            return Err(incomplete("the driver marks it as damaged".into()));
        }
        let bytes = bytes.get(..metadata.bytesused as usize).unwrap_or(bytes);
        let image = self
            .layout
            .without_padding(bytes, self.width, self.height, self.stride)
            .and_then(|bytes| self.layout.decode(&bytes, self.width, self.height))
            .map_err(|bad| incomplete(bad.to_string()))?;
        Ok(Some(Frame { image, stamp: stamp(metadata) }))
    }

    /// Driver control of a setting, and its steps per unit.
    fn control_of(&self, setting: &Setting) -> Option<(control::Description, f64)> {
        let (ids, steps): (&[u32], f64) = match setting {
            Setting::ExposureUs(_) => (&[EXPOSURE_ABSOLUTE], 1.0 / EXPOSURE_UNIT_US),
            Setting::Gain(_) => (&[GAIN, ANALOGUE_GAIN], 1.0),
            Setting::BlackLevel(_) => (&[BLACK_LEVEL, BRIGHTNESS], 1.0),
            _ => return None,
        };
        let mut known = self.descriptions();
        let at = ids.iter().find_map(|id| known.iter().position(|control| control.id == *id))?;
        Some((known.swap_remove(at), steps))
    }

    fn descriptions(&self) -> Vec<control::Description> {
        let device = std::panic::AssertUnwindSafe(&self.device);
        catch_unwind(|| device.query_controls()).ok().and_then(Result::ok).unwrap_or_default()
    }

    fn set_number(&mut self, setting: &Setting, value: f64) -> Result<(), CameraError> {
        let wrong = |expected: String| CameraError::Setting {
            name: setting.name(),
            value: setting.value(),
            expected,
        };
        let Some((control, steps)) = self.control_of(setting) else {
            return Err(wrong(format!("{} has no control for it", self.path.display())));
        };
        let range = number_range(&control, steps, setting);
        if !range.has(value) {
            return Err(wrong(format!("expected {range}")));
        }
        // Automatic modes are switched off; a driver without them needs nothing.
        let by_itself = match setting {
            Setting::ExposureUs(_) => Some((EXPOSURE_AUTO, EXPOSURE_AUTO_MANUAL)),
            Setting::Gain(_) => Some((AUTOGAIN, 0)),
            _ => None,
        };
        if let Some((id, value)) = by_itself {
            let _ = self.device.set_control(control::Control { id, value: Value::Integer(value) });
        }
        let value = Value::Integer((value * steps).round() as i64);
        self.device.set_control(control::Control { id: control.id, value }).map_err(self.failed())
    }
}

fn number_range(control: &control::Description, steps: f64, setting: &Setting) -> Range {
    let unit = if matches!(setting, Setting::ExposureUs(_)) { "us" } else { "" };
    Range::Number { min: control.minimum as f64 / steps, max: control.maximum as f64 / steps, unit }
}

/// Driver's count, and its time if monotonic.
fn stamp(metadata: &Metadata) -> Stamp {
    let monotonic = metadata.flags & Flags::TIMESTAMP_MASK == Flags::TIMESTAMP_MONOTONIC;
    Stamp { count: Some(metadata.sequence.into()), time: monotonic.then(|| metadata.timestamp.into()) }
}

impl Camera for V4lCamera {
    fn kind(&self) -> &'static str {
        "v4l"
    }

    fn arm(&mut self, mode: TriggerMode, exposure: Micros) -> Result<(), CameraError> {
        // Frames of a free-running camera cannot be assigned to exposures.
        if mode != TriggerMode::Hardware {
            return Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(mode) });
        }
        let exposure = Setting::ExposureUs(f64::from(exposure.0));
        // Without the control the pulse length or the camera's own setting applies.
        if self.control_of(&exposure).is_some() {
            self.set(&exposure)?;
        }
        self.restart()
    }

    fn sets_exposure(&mut self, _: TriggerMode) -> bool {
        self.control_of(&Setting::ExposureUs(0.0)).is_some()
    }

    fn pairs_by_frames_before(&self) -> bool {
        true
    }

    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(TriggerMode::Software) })
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let camera = self.path.display().to_string();
        while let Some(frame) = self.next(wait)? {
            if let Some(image) = self.pairing.image(&camera, frame, shot)? {
                return Ok(image);
            }
        }
        Err(CameraError::Late { camera, trigger_number: shot.trigger_number, waited: wait })
    }

    fn reported(&mut self, shot: &ShotRecord, received: Instant) {
        self.pairing.reported(shot, received);
    }

    fn quiet_time(&self) -> Duration {
        self.pairing.quiet_time()
    }

    fn finish(&mut self, wait: Duration) -> Result<(), CameraError> {
        match self.next(wait)? {
            Some(_) => Err(CameraError::Surplus { camera: self.path.display().to_string() }),
            None => Ok(()),
        }
    }

    fn controls(&mut self) -> Result<Vec<Control>, CameraError> {
        let settings = [Setting::ExposureUs(0.0), Setting::Gain(0.0), Setting::BlackLevel(0.0)];
        let mut controls = Vec::new();
        for setting in settings {
            let Some((control, steps)) = self.control_of(&setting) else { continue };
            let value = match self.device.control(control.id).map_err(self.failed())?.value {
                Value::Integer(value) => (value as f64 / steps).to_string(),
                other => format!("{other:?}"),
            };
            let range = number_range(&control, steps, &setting);
            controls.push(Control { name: setting.name().into(), value, range });
        }
        let format = self.device.format().map_err(self.failed())?;
        let offered = self.device.enum_formats().map_err(self.failed())?;
        let names = offered.iter().map(|format| format.fourcc.to_string().trim().to_owned()).collect();
        let value = format.fourcc.to_string().trim().to_owned();
        controls.push(Control { name: "pixel_format".into(), value, range: Range::Choice(names) });
        let value = format!("0,0,{},{}", format.width, format.height);
        controls.push(Control { name: "region".into(), value, range: Range::Fixed });
        Ok(controls)
    }

    fn set(&mut self, setting: &Setting) -> Result<(), CameraError> {
        let wrong = |expected: String| CameraError::Setting {
            name: setting.name(),
            value: setting.value(),
            expected,
        };
        match setting {
            Setting::ExposureUs(value) | Setting::Gain(value) | Setting::BlackLevel(value) => {
                self.set_number(setting, *value)
            }
            Setting::PixelFormat(name) => {
                let read =
                    super::FORMATS.into_iter().find(|(format, _)| format.trim_ascii() == name.as_bytes());
                let (format, layout) =
                    read.ok_or_else(|| wrong("expected a format that `camera show` lists".into()))?;
                self.choose(format, layout)
            }
            Setting::Region(_) | Setting::TriggerSource(_) => {
                Err(wrong("drivers of Video4Linux have their own tools for it, e.g. v4l2-ctl".into()))
            }
        }
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.restart()
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        let Some(first) = self.take(wait)? else { return Ok(None) };
        let mut newest = Some(first);
        // At most the buffered frames: decoding may take longer than an exposure.
        for _ in 1..BUFFERS {
            match self.take(Duration::ZERO)? {
                Some(newer) => newest = Some(newer),
                None => break,
            }
        }
        Ok(newest)
    }
}
