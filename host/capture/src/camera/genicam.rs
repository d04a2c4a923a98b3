//! GigE and USB3 Vision cameras through Aravis (SFNC names); feature `genicam`, as it needs `libaravis-dev` (Debian).

mod payload;
mod settings;

use std::{
    cell::OnceCell,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::channel,
    },
    thread,
    time::{Duration, Instant},
};

use aravis::{
    AcquisitionMode, Aravis, Buffer, BufferPayloadType, BufferStatus, DeviceError, GvDevice, GvStream,
    PixelFormat, Stream, glib::object::Cast, prelude::*,
};
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};

use super::{Camera, CameraError, Control, Frame, Image, Setting, Stamp, pairing::Pairing, pixels::Layout};
use crate::describe::trigger_name;

const BUFFERS: usize = 16;
const USUAL_TICKS: i64 = 1_000_000_000;
const SOFTWARE: &str = "Software";
/// Longest wait for a camera to stop at disconnection. Aravis repeats each request to a silent one for seconds.
const FAREWELL: Duration = Duration::from_secs(1);

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FoundCamera {
    pub id: String,
    /// Vendor, model and transport.
    pub about: String,
}

/// Discovers cameras on all networks and USB; takes about a second.
pub fn devices() -> Vec<FoundCamera> {
    static LIBRARY: Mutex<Option<Aravis>> = Mutex::new(None);
    let mut library = LIBRARY.lock().unwrap_or_else(PoisonError::into_inner);
    if library.is_none() {
        *library = Aravis::initialize().ok(); // may be had once, and stays
    }
    let text = |text: &std::ffi::CStr| text.to_string_lossy().into_owned();
    let found = library.as_ref().map(Aravis::get_device_list).unwrap_or_default();
    found
        .iter()
        .map(|device| FoundCamera {
            id: text(&device.id),
            about: format!(
                "{} {} ({} at {})",
                text(&device.vendor),
                text(&device.model),
                text(&device.protocol),
                text(&device.address)
            ),
        })
        .collect()
}

pub struct GenicamCamera {
    id: String,
    camera: aravis::Camera,
    stream: Option<Stream>,
    chunks: Option<aravis::ChunkParser>,
    /// Size and format of the acquisition's frames, if a frame was without them.
    announced: OnceCell<((i32, i32), PixelFormat)>,
    ticks_per_second: i64,
    pairing: Pairing,
    /// Trigger line; `None`: the camera's first.
    trigger_source: Option<String>,
    lost: Arc<AtomicBool>,
}

impl GenicamCamera {
    /// Opens a camera by its id from [`devices`], its address or its user-defined name, or the first one if empty. Fails if
    /// absent or in use.
    pub fn open(id: &str) -> Result<Self, CameraError> {
        let found = devices();
        let there = |found: &[FoundCamera]| {
            let names: Vec<&str> = found.iter().map(|camera| camera.id.as_str()).collect();
            match names.is_empty() {
                true => "no GigE Vision or USB3 Vision camera answers: is it powered, is the cable in, do both lie in one subnet?".into(),
                false => format!("it does not answer; there are {}", names.join(", ")),
            }
        };
        let Some(first) = found.first() else { return Err(unusable(id, there(&found))) };
        let id = if id.is_empty() { first.id.clone() } else { id.to_owned() };
        let camera = aravis::Camera::new(Some(id.as_str())).map_err(|error| {
            let reason = if error.matches(DeviceError::NotFound) {
                there(&found)
            } else if error.matches(DeviceError::Timeout) {
                "it answers the search but no command: give it and the network card addresses in one subnet".into()
            } else {
                format!("{error}; another program may hold it, or your user may not use it (USB3 Vision: a udev rule)")
            };
            unusable(&id, reason)
        })?;
        let lost = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&lost);
        let device = camera.device();
        // Aravis also opens a camera held by another program; writes then fail.
        let held = device.as_ref().and_then(|device| device.downcast_ref::<GvDevice>());
        if held.is_some_and(|device| !device.is_controller()) {
            let reason =
                "another program holds it; end that one (one that was killed holds it for some seconds more)";
            return Err(unusable(&id, reason.into()));
        }
        if let Some(device) = &device {
            device.connect_control_lost(move |_| flag.store(true, Ordering::Relaxed));
        }
        let register = held.and_then(|device| device.timestamp_tick_frequency().ok());
        let feature = camera.integer("GevTimestampTickFrequency").ok();
        let mut camera = Self {
            id,
            camera,
            stream: None,
            chunks: None,
            announced: OnceCell::new(),
            ticks_per_second: ticks_per_second(register, feature),
            pairing: Pairing::default(),
            trigger_source: None,
            lost,
        };
        camera.ask_for_chunks();
        Ok(camera)
    }

    /// Tolerated jitter of time stamps against the strobe, for software clocks such as Aravis' fake camera.
    #[must_use]
    pub fn with_jitter(mut self, jitter: Duration) -> Self {
        self.pairing = Pairing::with_jitter(jitter);
        self
    }

    /// Enables frame number and time chunks, if available.
    fn ask_for_chunks(&mut self) {
        if self.camera.set_chunk_mode(true).is_err() {
            return;
        }
        // SFNC names; without them the GigE Vision leader is used.
        for chunk in ["Timestamp", "FrameID"] {
            let _ = self.camera.set_chunk_state(chunk, true);
        }
        self.chunks = self.camera.create_chunk_parser();
    }

    fn failed(&self) -> impl Fn(aravis::glib::Error) -> CameraError + '_ {
        move |error| {
            let silent = self.lost.load(Ordering::Relaxed) || error.matches(DeviceError::Timeout);
            // Aravis also reports a missing channel or packets of 0 bytes for a silent camera, so query again.
            match silent || !self.answers() {
                true => self.gone(),
                false => unusable(&self.id, error.to_string()),
            }
        }
    }

    /// Whether its first register (GigE Vision and USB3 Vision version) can be read; takes seconds otherwise.
    fn answers(&self) -> bool {
        self.camera.device().is_some_and(|device| device.read_register(0).is_ok())
    }

    fn gone(&self) -> CameraError {
        let reason = "it does not answer any more; is it powered, is the cable in?".into();
        CameraError::Gone { address: self.id.clone(), reason }
    }

    fn stop(&mut self) -> Result<(), CameraError> {
        if self.stream.take().is_some() {
            self.camera.stop_acquisition().map_err(self.failed())?;
        }
        Ok(())
    }

    /// The frame that came too early, or the next one; `None` at the timeout.
    fn next(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        self.pairing.early().map_or_else(|| self.take(wait), |frame| Ok(Some(frame)))
    }

    fn start(&mut self) -> Result<(), CameraError> {
        let stream = self.streaming().map_err(self.failed())?;
        self.stream = Some(stream);
        self.announced = OnceCell::new();
        self.pairing.begin();
        Ok(())
    }

    fn streaming(&self) -> Result<Stream, aravis::glib::Error> {
        self.camera.set_acquisition_mode(AcquisitionMode::Continuous)?;
        let bytes = self.camera.payload()? as usize;
        let stream = self.camera.create_stream()?;
        for _ in 0..BUFFERS {
            stream.push_buffer(Buffer::new_allocate(bytes));
        }
        self.camera.start_acquisition()?;
        Ok(stream)
    }

    fn line(&self) -> Result<String, CameraError> {
        if let Some(source) = &self.trigger_source {
            return Ok(source.clone());
        }
        let sources = self.camera.dup_available_trigger_sources().map_err(self.failed())?;
        let line = sources.iter().find(|source| source.starts_with("Line"));
        line.map(ToString::to_string)
            .ok_or_else(|| unusable(&self.id, "it has no input line for a trigger".into()))
    }

    fn take(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        let Some(stream) = &self.stream else { return Ok(None) };
        let begin = Instant::now();
        let buffer = loop {
            let left = wait.saturating_sub(begin.elapsed());
            let micros = u64::try_from(left.as_micros()).unwrap_or(u64::MAX).max(1);
            let Some(buffer) = stream.timeout_pop_buffer(micros) else {
                return if self.lost.load(Ordering::Relaxed) { Err(self.gone()) } else { Ok(None) };
            };
            // Aravis returns an unfilled buffer for a packet that is not a camera's: those of other programs reach
            // its raw socket before its filter is set.
            if buffer.status() != BufferStatus::Cleared {
                break buffer;
            }
            stream.push_buffer(buffer);
        };
        let frame = self.frame(&buffer, stream);
        stream.push_buffer(buffer);
        frame.map(Some)
    }

    fn frame(&self, buffer: &Buffer, stream: &Stream) -> Result<Frame, CameraError> {
        let stamp = self.stamp(buffer);
        let incomplete = |reason: String| CameraError::Incomplete {
            camera: self.id.clone(),
            frame: stamp.count.unwrap_or_else(|| buffer.frame_id()),
            reason,
        };
        match buffer.status() {
            BufferStatus::Success => {}
            BufferStatus::MissingPackets | BufferStatus::Timeout => {
                return Err(incomplete(format!("packets were lost{}", packets(stream))));
            }
            BufferStatus::SizeMismatch => return Err(incomplete("it is larger than was announced".into())),
            other => return Err(incomplete(format!("{other:?}"))),
        }
        let (size, format, (padding, below), came) = match buffer.payload_type() {
            BufferPayloadType::Image
            | BufferPayloadType::ExtendedChunkData
            | BufferPayloadType::Multipart => {
                let size = (buffer.image_width(), buffer.image_height());
                (size, buffer.image_pixel_format(), buffer.image_padding(), buffer.image_data())
            }
            // Its leader has neither size nor format.
            BufferPayloadType::ChunkData => {
                let (size, format) = self.announced().map_err(self.failed())?;
                (size, format, (0, 0), payload::received(buffer))
            }
            other => {
                let reason = format!("its frames are {other:?}, expected images without compression");
                return Err(unusable(&self.id, reason));
            }
        };
        let (width, height) = (size.0.max(0) as usize, size.1.max(0) as usize);
        let layout = layout_of(format).ok_or_else(|| {
            unusable(
                &self.id,
                format!("its pixel format 0x{:08x} is not read: set one of Mono8 to Mono16", format.raw()),
            )
        })?;
        let [padding, below] = [padding, below].map(|bytes| usize::try_from(bytes).unwrap_or(0));
        let due = layout.frame_bytes(width, height).unwrap_or(usize::MAX);
        let unlike =
            || format!("{} bytes where {width}x{height} px of 0x{:08x} have {due}", came.len(), format.raw());
        let bytes = match buffer.payload_type() {
            BufferPayloadType::ChunkData => payload::image_chunk(&came, due).ok_or_else(|| {
                unusable(&self.id, format!("none of its chunks is the image: {}", unlike()))
            })?,
            BufferPayloadType::Image | BufferPayloadType::Multipart
                if !buffer.has_chunks()
                    && payload::exceeds(came.len(), due.saturating_add(padding * height + below)) =>
            {
                return Err(incomplete(unlike()));
            }
            _ => came.as_slice(),
        };
        let image =
            layout.decode_padded(bytes, width, height, padding).map_err(|bad| incomplete(bad.to_string()))?;
        Ok(Frame { image, stamp })
    }

    /// Size and format do not change during an acquisition, and each query is a round trip to the camera.
    fn announced(&self) -> Result<((i32, i32), PixelFormat), aravis::glib::Error> {
        if let Some(known) = self.announced.get() {
            return Ok(*known);
        }
        let (_, _, width, height) = self.camera.region()?;
        let format = self.camera.pixel_format()?;
        Ok(*self.announced.get_or_init(|| ((width, height), format)))
    }

    /// Number and time from chunks, else from the frame's leader.
    fn stamp(&self, buffer: &Buffer) -> Stamp {
        let chunk = |name| {
            let parser = self.chunks.as_ref().filter(|_| buffer.has_chunks())?;
            u64::try_from(parser.integer_value(buffer, name).ok()?).ok()
        };
        let count = chunk("ChunkFrameID").unwrap_or_else(|| buffer.frame_id());
        let by_chunk = chunk("ChunkTimestamp").map(|ticks| {
            Duration::from_nanos((u128::from(ticks) * 1_000_000_000 / self.ticks_per_second as u128) as u64)
        });
        let by_leader = Some(buffer.timestamp()).filter(|time| *time > 0).map(Duration::from_nanos);
        Stamp { count: Some(count), time: by_chunk.or(by_leader) }
    }
}

/// Frequency of the camera's clock. Some descriptions lack the feature; Aravis reads the leader's time by the register.
fn ticks_per_second(register: Option<u64>, feature: Option<i64>) -> i64 {
    let register = register.and_then(|ticks| i64::try_from(ticks).ok());
    [register, feature].into_iter().flatten().find(|ticks| *ticks > 0).unwrap_or(USUAL_TICKS)
}

fn packets(stream: &Stream) -> String {
    stream.downcast_ref::<GvStream>().map_or_else(String::new, |stream| {
        let (resent, missing) = stream.statistics();
        format!(" ({missing} missing and {resent} sent again since the start)")
    })
}

fn layout_of(format: PixelFormat) -> Option<Layout> {
    /// PFNC: 10 and 12 bits, bit-packed; missing in the bindings.
    const MONO_10P: u32 = 0x010a_0046;
    const MONO_12P: u32 = 0x010c_0047;
    match format {
        PixelFormat::MONO_8 => Some(Layout::Grey8 { colour_twelfths: 0 }),
        PixelFormat::MONO_10 => Some(Layout::Grey16 { bits: 10 }),
        PixelFormat::MONO_12 => Some(Layout::Grey16 { bits: 12 }),
        PixelFormat::MONO_14 => Some(Layout::Grey16 { bits: 14 }),
        PixelFormat::MONO_16 => Some(Layout::Grey16 { bits: 16 }),
        PixelFormat::MONO_10_PACKED => Some(Layout::GigePacked10),
        PixelFormat::MONO_12_PACKED => Some(Layout::GigePacked12),
        other if other.raw() == MONO_10P => Some(Layout::Packed10),
        other if other.raw() == MONO_12P => Some(Layout::Packed12),
        _ => None,
    }
}

fn unusable(id: &str, reason: String) -> CameraError {
    CameraError::Unusable { camera: format!("genicam:{id}"), reason }
}

impl Camera for GenicamCamera {
    fn kind(&self) -> &'static str {
        "genicam"
    }

    fn arm(&mut self, mode: TriggerMode, exposure: Micros) -> Result<(), CameraError> {
        self.stop()?;
        let source = match mode {
            TriggerMode::Hardware => self.line()?,
            TriggerMode::Software => SOFTWARE.into(),
            // Frames of a free-running camera cannot be assigned to exposures.
            TriggerMode::FreeRunning => {
                return Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(mode) });
            }
        };
        self.steady()?;
        // Some cameras leave TriggerWidth when their exposure time is set.
        if exposure.0 > 0 && self.sets_exposure(mode) {
            self.set(&Setting::ExposureUs(f64::from(exposure.0)))?;
        }
        self.set_trigger(&source)?;
        self.start()
    }

    fn sets_exposure(&mut self, mode: TriggerMode) -> bool {
        let by_pulse = self.entry("ExposureMode").is_some_and(|mode| mode == "TriggerWidth");
        // A software trigger has no width.
        mode == TriggerMode::Software || !by_pulse
    }

    fn pairs_by_frames_before(&self) -> bool {
        true
    }

    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        self.camera.software_trigger().map_err(self.failed())
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        while let Some(frame) = self.next(wait)? {
            if let Some(image) = self.pairing.image(&self.id, frame, shot)? {
                return Ok(image);
            }
        }
        Err(CameraError::Late { camera: self.id.clone(), trigger_number: shot.trigger_number, waited: wait })
    }

    fn reported(&mut self, shot: &ShotRecord, received: Instant) {
        self.pairing.reported(shot, received);
    }

    fn quiet_time(&self) -> Duration {
        self.pairing.quiet_time()
    }

    fn finish(&mut self, wait: Duration) -> Result<(), CameraError> {
        match self.next(wait)? {
            Some(_) => Err(CameraError::Surplus { camera: self.id.clone() }),
            None => Ok(()),
        }
    }

    fn controls(&mut self) -> Result<Vec<Control>, CameraError> {
        self.all_controls()
    }

    fn set(&mut self, setting: &Setting) -> Result<(), CameraError> {
        match setting {
            Setting::ExposureUs(value) | Setting::Gain(value) | Setting::BlackLevel(value) => {
                self.set_number(setting, *value)
            }
            Setting::PixelFormat(name) => {
                let known = self.camera.dup_available_pixel_formats_as_strings().map_err(self.failed())?;
                self.choice(setting, name, &known)?;
                self.stop()?; // the size of a frame changes
                self.camera.set_pixel_format_from_string(name).map_err(self.failed())
            }
            Setting::Region(region) => {
                self.stop()?;
                self.set_region(setting, *region)
            }
            Setting::TriggerSource(name) => {
                let known = self.camera.dup_available_trigger_sources().map_err(self.failed())?;
                self.choice(setting, name, &known)?;
                self.trigger_source = Some(name.clone());
                Ok(())
            }
        }
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.stop()?;
        self.triggers_off()?;
        self.start()
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        // Older frames are skipped undecoded: decoding may take longer than an exposure.
        if let Some(stream) = &self.stream {
            let waiting = stream.n_buffers().1;
            for _ in 1..waiting {
                if let Some(older) = stream.try_pop_buffer() {
                    stream.push_buffer(older);
                }
            }
        }
        self.take(wait)
    }
}

impl Drop for GenicamCamera {
    /// Where the camera is silent, the thread has the last reference and gives it up later.
    fn drop(&mut self) {
        let (camera, stream) = (self.camera.clone(), self.stream.take());
        let (caller_waits, end) = channel::<()>();
        let stop = move || {
            let has_stopped = stream.is_some_and(|stream| {
                drop(stream);
                camera.stop_acquisition().is_ok()
            });
            // A camera may refuse to stop.
            let answers = || camera.device().is_some_and(|device| device.read_register(0).is_ok());
            if !has_stopped && !answers() {
                drop(caller_waits);
                thread::sleep(FAREWELL);
            }
            drop(camera);
        };
        if thread::Builder::new().name("camera end".into()).spawn(stop).is_ok() {
            let _ = end.recv_timeout(FAREWELL);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_register_gives_the_clock_of_a_description_without_it() {
        assert_eq!(ticks_per_second(Some(125_000_000), None), 125_000_000);
        assert_eq!(ticks_per_second(Some(0), Some(8_000_000)), 8_000_000);
        assert_eq!(ticks_per_second(None, Some(0)), USUAL_TICKS);
    }
}
