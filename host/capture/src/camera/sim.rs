//! The simulator's camera: images over a loopback TCP stream ([`farnear_protocol::camera`]).

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use farnear_protocol::camera::{Control, FRAME_HEADER, FrameHeader};
use farnear_protocol::message::ShotRecord;
use ndarray::Array2;

use super::{Camera, CameraError, Image};

const CONNECT: Duration = Duration::from_secs(5);
/// Images that wait to be fetched; a full queue holds the sender back, and memory stays bounded.
const QUEUE: usize = 8;

/// A connection to the camera endpoint of `farnear-sim`.
pub struct SimCamera {
    address: String,
    stream: TcpStream,
    frames: Receiver<Result<Frame, CameraError>>,
    // Reads all the time, so that the simulator is not held up while the host waits for the board's events.
    reader: Option<JoinHandle<()>>,
}

struct Frame {
    header: FrameHeader,
    pixels: Vec<u16>,
}

impl SimCamera {
    /// Connects to `host:port`.
    pub fn connect(address: &str) -> Result<Self, CameraError> {
        let failed = |reason: String| CameraError::Connect { address: address.into(), reason };
        let resolved = address.to_socket_addrs().map_err(|error| failed(error.to_string()))?.next();
        let resolved = resolved.ok_or_else(|| failed("the name leads nowhere".into()))?;
        let stream =
            TcpStream::connect_timeout(&resolved, CONNECT).map_err(|error| failed(error.to_string()))?;
        let mut input = stream.try_clone().map_err(|error| failed(error.to_string()))?;
        let (sender, frames) = sync_channel(QUEUE);
        let name = address.to_string();
        let reader = std::thread::spawn(move || {
            loop {
                let frame = read_frame(&mut input, &name);
                let last = frame.is_err();
                if sender.send(frame).is_err() || last {
                    return;
                }
            }
        });
        Ok(Self { address: address.into(), stream, frames, reader: Some(reader) })
    }

    /// Lets virtual time pass in the simulator though nothing is under way there.
    pub fn advance(&mut self, micros: u64) -> Result<(), CameraError> {
        let gone = |reason: String| CameraError::Gone { address: self.address.clone(), reason };
        let mut buffer = [0; 16];
        let body = postcard::to_slice(&Control::AdvanceMicros(micros), &mut buffer)
            .map_err(|error| gone(error.to_string()))?;
        let length = (body.len() as u32).to_le_bytes();
        self.stream.write_all(&[&length, &*body].concat()).map_err(|error| gone(error.to_string()))
    }
}

impl Camera for SimCamera {
    fn kind(&self) -> &'static str {
        "sim"
    }

    fn arm(&mut self) -> Result<(), CameraError> {
        // An older image is told by its trigger number when it comes up.
        Ok(())
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let until = Instant::now() + wait;
        let wanted = shot.trigger_number;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let frame = match self.frames.recv_timeout(left) {
                Ok(frame) => frame?,
                Err(RecvTimeoutError::Timeout) => {
                    return Err(CameraError::Late {
                        camera: format!("simulator at {}", self.address),
                        trigger_number: wanted,
                        waited: wait,
                    });
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let reason = "the stream has ended".into();
                    return Err(CameraError::Gone { address: self.address.clone(), reason });
                }
            };
            let FrameHeader { shot_id, width, height, bits, .. } = frame.header;
            match shot_id.wrapping_sub(wanted) as i32 {
                ..0 => {}
                0 => {
                    let size = (usize::from(height), usize::from(width));
                    let pixels = Array2::from_shape_vec(size, frame.pixels).map_err(|error| {
                        CameraError::Nonsense { address: self.address.clone(), reason: error.to_string() }
                    })?;
                    return Ok(Image { pixels, bits });
                }
                _ => return Err(CameraError::Skipped { wanted, came: shot_id }),
            }
        }
    }
}

impl Drop for SimCamera {
    fn drop(&mut self) {
        let _ = self.stream.shutdown(Shutdown::Both);
        // A reader that waits with a full queue sees that nobody fetches any more.
        self.frames = sync_channel(0).1;
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

fn read_frame(input: &mut impl Read, address: &str) -> Result<Frame, CameraError> {
    let gone = |error: io::Error| CameraError::Gone { address: address.into(), reason: error.to_string() };
    let nonsense = |reason: String| CameraError::Nonsense { address: address.into(), reason };
    let mut length = [0; 4];
    input.read_exact(&mut length).map_err(gone)?;
    let mut header = [0; FRAME_HEADER];
    input.read_exact(&mut header).map_err(gone)?;
    let length = u32::from_le_bytes(length);
    let header =
        FrameHeader::from_bytes(&header).ok_or_else(|| nonsense("a header with no picture in it".into()))?;
    // Checked before the pixels are read, so that the size below is that of a 16-bit width and height.
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

    #[test]
    fn frames_are_read_and_nonsense_is_refused() {
        let frame = read_frame(&mut frame_bytes(0, 12, &[0, 4095]).as_slice(), "a").unwrap();
        assert_eq!(frame.pixels, [0, 4095]);
        assert_eq!(frame.header.shot_id, 3);
        let reading = |bytes: Vec<u8>| read_frame(&mut bytes.as_slice(), "a").err().unwrap();
        assert!(matches!(reading(frame_bytes(1, 12, &[0])), CameraError::Nonsense { .. }));
        assert!(matches!(reading(frame_bytes(0, 12, &[4096])), CameraError::Nonsense { .. }));
        assert!(matches!(reading(frame_bytes(0, 7, &[1])), CameraError::Nonsense { .. }));
        let mut cut = frame_bytes(0, 8, &[1, 2]);
        cut.pop();
        assert!(matches!(reading(cut), CameraError::Gone { .. }));
    }
}
