//! The simulator's camera: images on a loopback TCP stream ([`farnear_protocol::camera`]).

use std::{
    collections::VecDeque,
    io::{self, Read, Write},
    net::{Shutdown, TcpStream, ToSocketAddrs},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use farnear_protocol::{
    camera::{Control, FRAME_HEADER, FREE_RUNNING, FrameHeader, IN_USE},
    message::{ShotRecord, TriggerMode, strobe_tolerance},
    units::Micros,
};
use ndarray::Array2;

use super::{Camera, CameraError, Frame as Picture, Image, Stamp};

const CONNECT: Duration = Duration::from_secs(5);
/// Longest wait for the simulator to end the stream at disconnection.
const FAREWELL: Duration = Duration::from_millis(500);
/// Image queue; a full queue blocks the sender and bounds the memory.
const QUEUE: usize = 8;
/// Minimum gap of free-running exposures: read-out and a margin.
const BETWEEN_EXPOSURES_US: u32 = 15_000;
/// Tolerance between strobe and reported exposure start, beyond what the board lets a strobe lose.
const SAME_MOMENT_US: u64 = 50;
const WATCH_EXPOSURE: Micros = Micros(5_000);
const STREAM_ENDED: &str = "the stream has ended";

pub struct SimCamera {
    address: String,
    stream: TcpStream,
    queue: Arc<Queue>,
    // Reads continuously, so that the simulator is not blocked while the host waits for events.
    reader: Option<JoinHandle<()>>,
    ended: Receiver<()>,
    runs_freely: bool,
    /// Image that replaces an earlier one.
    early: Option<Frame>,
    /// Last image since arming that belonged to an earlier exposure than the due one.
    passed: Option<u32>,
}

struct Frame {
    header: FrameHeader,
    pixels: Vec<u16>,
}

#[derive(Default)]
struct Queue {
    frames: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    frames: VecDeque<Result<Frame, CameraError>>,
    closed: bool,
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for room; free-running images replace the oldest instead. Returns whether there is a consumer.
    fn push(&self, frame: Result<Frame, CameraError>) -> bool {
        let mut waiting = self.lock();
        while waiting.frames.len() >= QUEUE && !waiting.closed {
            let idle =
                |frame: &Result<Frame, _>| matches!(frame, Ok(frame) if frame.header.shot_id == FREE_RUNNING);
            if waiting.frames.front().is_some_and(idle) {
                waiting.frames.pop_front();
            } else {
                waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
            }
        }
        waiting.frames.push_back(frame);
        self.changed.notify_all();
        !waiting.closed
    }

    /// Drops the frames that came. An error stays, because no frame follows it.
    fn drop_frames(&self) {
        self.lock().frames.retain(Result::is_err);
        self.changed.notify_all();
    }

    /// `None` at the timeout, an error if no more can come.
    fn pop(&self, until: Instant) -> Result<Option<Result<Frame, CameraError>>, ()> {
        let mut waiting = self.lock();
        loop {
            if let Some(frame) = waiting.frames.pop_front() {
                self.changed.notify_all();
                return Ok(Some(frame));
            }
            let left = until.saturating_duration_since(Instant::now());
            if waiting.closed {
                return Err(());
            }
            if left.is_zero() {
                return Ok(None);
            }
            waiting = self.changed.wait_timeout(waiting, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }
}

impl SimCamera {
    pub fn connect(address: &str) -> Result<Self, CameraError> {
        let failed = |reason: String| CameraError::Connect { address: address.into(), reason };
        let resolved = address.to_socket_addrs().map_err(|error| failed(error.to_string()))?.next();
        let resolved = resolved.ok_or_else(|| failed("the name leads nowhere".into()))?;
        let stream =
            TcpStream::connect_timeout(&resolved, CONNECT).map_err(|error| failed(error.to_string()))?;
        let mut input = stream.try_clone().map_err(|error| failed(error.to_string()))?;
        let queue = Arc::new(Queue::default());
        let (filled, name) = (Arc::clone(&queue), address.to_string());
        let (reading, ended) = channel();
        let reader = std::thread::spawn(move || {
            loop {
                let frame = read_frame(&mut input, &name);
                let last = frame.is_err();
                if !filled.push(frame) || last {
                    break;
                }
            }
            filled.close();
            // Drains the stream until the simulator has noticed the disconnection.
            let _ = io::copy(&mut input, &mut io::sink());
            drop(reading);
        });
        let reader = Some(reader);
        Ok(Self {
            address: address.into(),
            stream,
            queue,
            reader,
            ended,
            runs_freely: false,
            early: None,
            passed: None,
        })
    }

    pub fn advance(&mut self, micros: u64) -> Result<(), CameraError> {
        self.control(&Control::AdvanceMicros(micros))
    }

    fn image_of(&self, frame: Frame) -> Result<Image, CameraError> {
        let FrameHeader { width, height, bits, .. } = frame.header;
        let size = (usize::from(height), usize::from(width));
        let pixels = Array2::from_shape_vec(size, frame.pixels).map_err(|error| CameraError::Nonsense {
            address: self.address.clone(),
            reason: error.to_string(),
        })?;
        Ok(Image::new(pixels, bits))
    }

    fn ended(&self) -> CameraError {
        CameraError::Gone { address: self.address.clone(), reason: STREAM_ENDED.into() }
    }

    fn control(&mut self, control: &Control) -> Result<(), CameraError> {
        let gone = |reason: String| CameraError::Gone { address: self.address.clone(), reason };
        let mut buffer = [0; 32];
        let body = postcard::to_slice(control, &mut buffer).map_err(|error| gone(error.to_string()))?;
        let length = (body.len() as u32).to_le_bytes();
        self.stream.write_all(&[&length, &*body].concat()).map_err(|error| gone(error.to_string()))
    }
}

impl Camera for SimCamera {
    fn kind(&self) -> &'static str {
        "sim"
    }

    fn arm(&mut self, mode: TriggerMode, exposure: Micros) -> Result<(), CameraError> {
        // After a reset of the board its number would be a later one. Old images that are still on their way are recognised by
        // an earlier time or a lower number.
        (self.early, self.passed) = (None, None);
        self.queue.drop_frames();
        let free = mode == TriggerMode::FreeRunning;
        if free {
            let period = Micros(exposure.0.saturating_add(BETWEEN_EXPOSURES_US));
            self.control(&Control::FreeRun { period, exposure })?;
        } else if self.runs_freely {
            self.control(&Control::FreeRun { period: Micros(0), exposure })?;
        }
        self.runs_freely = free;
        Ok(())
    }

    fn trigger(&mut self, trigger_number: u32, exposure: Micros) -> Result<(), CameraError> {
        self.control(&Control::Expose { shot_id: trigger_number, exposure })
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let until = Instant::now() + wait;
        let wanted = shot.trigger_number;
        loop {
            let frame =
                match self.early.take().map_or_else(|| self.queue.pop(until), |frame| Ok(Some(Ok(frame)))) {
                    Ok(Some(frame)) => frame?,
                    Ok(None) => {
                        let passed = self.passed.map_or_else(String::new, |number| {
                            format!(", whose last image was that of exposure {number}")
                        });
                        return Err(CameraError::Late {
                            camera: format!("simulator at {}{passed}", self.address),
                            trigger_number: wanted,
                            waited: wait,
                        });
                    }
                    Err(()) => return Err(self.ended()),
                };
            let FrameHeader { shot_id, exposure, .. } = frame.header;
            let apart_us = exposure.0.abs_diff(shot.strobe_start.0);
            let later = if apart_us <= SAME_MOMENT_US + u64::from(strobe_tolerance(shot.exposure).0) {
                // The simulator does not know the number of an exposure that failed without a trigger.
                0
            } else if shot_id == FREE_RUNNING {
                if exposure < shot.strobe_start { -1 } else { 1 }
            } else if shot_id == wanted || exposure < shot.strobe_start {
                // From before a reset of the board, which numbers from 0 again.
                -1
            } else {
                shot_id.wrapping_sub(wanted) as i32
            };
            match later {
                ..0 => self.passed = (shot_id != FREE_RUNNING).then_some(shot_id),
                0 => return self.image_of(frame),
                _ => {
                    self.early = Some(frame);
                    return Err(CameraError::Skipped { wanted, came: shot_id });
                }
            }
        }
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.arm(TriggerMode::FreeRunning, WATCH_EXPOSURE)
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Picture>, CameraError> {
        // Idle virtual time does not advance; advance it by one picture.
        self.advance(u64::from(WATCH_EXPOSURE.0 + BETWEEN_EXPOSURES_US))?;
        let frame = match self.queue.pop(Instant::now() + wait) {
            Ok(Some(frame)) => frame?,
            Ok(None) => return Ok(None),
            Err(()) => return Err(self.ended()),
        };
        let time = Some(Duration::from_micros(frame.header.exposure.0));
        Ok(Some(Picture { image: self.image_of(frame)?, stamp: Stamp { count: None, time } }))
    }
}

impl Drop for SimCamera {
    fn drop(&mut self) {
        let _ = self.stream.shutdown(Shutdown::Write);
        // Closing the queue ends a blocked reader; ending the stream ends a waiting one.
        self.queue.close();
        let _ = self.ended.recv_timeout(FAREWELL);
        let _ = self.stream.shutdown(Shutdown::Both);
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

fn read_frame(input: &mut impl Read, address: &str) -> Result<Frame, CameraError> {
    let gone = |error: io::Error| {
        let reason = match error.kind() {
            io::ErrorKind::UnexpectedEof => STREAM_ENDED.into(),
            _ => error.to_string(),
        };
        CameraError::Gone { address: address.into(), reason }
    };
    let nonsense = |reason: String| CameraError::Nonsense { address: address.into(), reason };
    let mut length = [0; 4];
    input.read_exact(&mut length).map_err(gone)?;
    if u32::from_le_bytes(length) == IN_USE {
        return Err(CameraError::InUse { address: address.into() });
    }
    let mut header = [0; FRAME_HEADER];
    input.read_exact(&mut header).map_err(gone)?;
    let length = u32::from_le_bytes(length);
    let header =
        FrameHeader::from_bytes(&header).ok_or_else(|| nonsense("a header with no picture in it".into()))?;
    // Checked before the pixels are read, which bounds the size below.
    if length != header.length() {
        return Err(nonsense(format!("a frame of {length} bytes where {} were due", header.length())));
    }
    let mut bytes = vec![0; 2 * usize::from(header.width) * usize::from(header.height)];
    input.read_exact(&mut bytes).map_err(gone)?;
    let pixels: Vec<u16> = bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    if let Some(value) = pixels.iter().find(|value| u32::from(**value) >> header.bits != 0) {
        return Err(nonsense(format!("a pixel of {value} in an image of {} bits", header.bits)));
    }
    Ok(Frame { header, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_protocol::units::BoardMicros;

    fn frame_bytes(length_off: u32, bits: u8, pixels: &[u16]) -> Vec<u8> {
        let header =
            FrameHeader { shot_id: 3, exposure: BoardMicros(5), width: pixels.len() as u16, height: 1, bits };
        let mut bytes = (header.length() + length_off).to_le_bytes().to_vec();
        bytes.extend(header.to_bytes());
        bytes.extend(pixels.iter().flat_map(|pixel| pixel.to_le_bytes()));
        bytes
    }

    /// Images with higher numbers are older than the board's reset, after which it counts from 0 again.
    #[test]
    fn images_that_came_before_arming_or_were_exposed_earlier_are_passed_over() {
        let image = |shot_id: u32, at_us: u64| {
            let exposure = BoardMicros(at_us);
            let header = FrameHeader { shot_id, exposure, width: 1, height: 1, bits: 8 };
            [&header.length().to_le_bytes()[..], &header.to_bytes(), &[shot_id as u8, 0]].concat()
        };
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut camera = SimCamera::connect(&listener.local_addr().unwrap().to_string()).unwrap();
        let (mut simulator, _) = listener.accept().unwrap();
        simulator.write_all(&image(7, 9_000_000)).unwrap();
        while camera.queue.lock().frames.is_empty() {
            std::thread::yield_now();
        }
        camera.arm(TriggerMode::Hardware, Micros(1)).unwrap();
        simulator.write_all(&[image(8, 100), image(0, 20_000)].concat()).unwrap();
        let shot = crate::continuous::tests::frame(0, 0).record;
        let shot = ShotRecord { strobe_start: BoardMicros(20_000), ..shot };
        assert_eq!(camera.image(&shot, Duration::from_secs(20)).unwrap().pixels[[0, 0]], 0);
    }

    #[test]
    fn reads_frames_and_rejects_invalid_ones() {
        let frame = read_frame(&mut frame_bytes(0, 12, &[0, 4095]).as_slice(), "a").unwrap();
        assert_eq!(frame.pixels, [0, 4095]);
        assert_eq!(frame.header.shot_id, 3);
        let reading = |bytes: Vec<u8>| read_frame(&mut bytes.as_slice(), "a").err().unwrap();
        assert!(matches!(reading(frame_bytes(1, 12, &[0])), CameraError::Nonsense { .. }));
        assert!(matches!(reading(frame_bytes(0, 12, &[4096])), CameraError::Nonsense { .. }));
        assert!(matches!(reading(frame_bytes(0, 7, &[1])), CameraError::Nonsense { .. }));
        let refused = reading(IN_USE.to_le_bytes().to_vec());
        assert!(refused.to_string().contains("another program"), "{refused}");
        let mut cut = frame_bytes(0, 8, &[1, 2]);
        cut.pop();
        assert!(matches!(reading(cut), CameraError::Gone { reason, .. } if reason == STREAM_ENDED));
    }
}
