//! The serial port that clients open: a pty. Forwards client bytes in whole frames. Bytes written together
//! stay together: later ones would reach the board in another state.

use std::{
    io::{ErrorKind, Read, Write},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::Receiver,
    },
    thread,
    time::Duration,
};

use farnear_protocol::frame::FRAME_MAX;
use serialport::{SerialPort, TTYPort};

use crate::{command::Command, error::SimError};

/// Read timeout: interval of checks for an unplugged port, and of whole frames waiting for an incomplete one.
const LOOK: Duration = Duration::from_millis(20);
/// A client that reads nothing for this long loses bytes, as on a real line.
const PATIENCE: Duration = Duration::from_millis(500);

/// Opens a pty and returns its name. Whole frames and changed baud rates go to `from_client`, which returns
/// whether it accepts more. The port closes when `to_client` ends.
pub fn open(
    to_client: Receiver<Vec<u8>>,
    from_client: impl Fn(Command) -> bool + Send + 'static,
) -> Result<String, SimError> {
    let (mut writer, slave) = TTYPort::pair()?;
    let name = slave.name().unwrap_or_default();
    let mut reader = writer.try_clone_native()?;
    reader.set_timeout(LOOK)?;
    writer.set_timeout(PATIENCE)?;
    let unplugged = Arc::new(AtomicBool::new(false));
    let seen = unplugged.clone();
    let no_thread = |source| SimError::Io { what: "cannot start the port's thread".into(), source };
    thread::Builder::new()
        .name("port out".into())
        .spawn(move || {
            for bytes in to_client {
                // Without a reader the bytes are lost.
                let _ = writer.write_all(&bytes);
            }
            unplugged.store(true, Ordering::Relaxed);
            // Kept open so that clients may reconnect.
            drop(slave);
        })
        .map_err(no_thread)?;
    thread::Builder::new()
        .name("port in".into())
        .spawn(move || read(&mut reader, &seen, &from_client))
        .map_err(no_thread)?;
    Ok(name)
}

fn read(port: &mut TTYPort, unplugged: &AtomicBool, from_client: &impl Fn(Command) -> bool) {
    let mut cutter = FrameCutter::default();
    let mut bytes = [0; 4096];
    let mut rate = None;
    let mut frames = Vec::new();
    while !unplugged.load(Ordering::Relaxed) {
        let rest_may_come = match port.read(&mut bytes) {
            Ok(count) => {
                // The client's baud rate can be read at this end of a pty.
                let now = port.baud_rate().ok();
                if now != rate && !now.is_some_and(|baud| from_client(Command::HostRate(baud))) {
                    return;
                }
                rate = now;
                frames.extend(cutter.cut(&bytes[..count]).concat());
                cutter.is_within_frame()
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => false,
            Err(_) => {
                thread::sleep(LOOK);
                false
            }
        };
        if !frames.is_empty() && !rest_may_come && !from_client(Command::Bytes(std::mem::take(&mut frames))) {
            return;
        }
    }
}

/// Limit for noise without a delimiter; drops the rest. 1 MB would block the line for five seconds.
const NOISE_MAX: usize = 4096;

/// Cuts a byte stream into frames with their delimiters, and garbage into pieces. A single delimiter, which
/// ends a broken frame, is joined to the next frame: on its own it would let a host-dependent time pass.
#[derive(Debug, Default)]
pub struct FrameCutter {
    piece: Vec<u8>,
    run: usize,
}

impl FrameCutter {
    pub fn cut(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        for byte in bytes {
            if *byte == 0 && self.run == 0 {
                self.piece = vec![0];
                continue;
            }
            self.run = if *byte == 0 { 0 } else { self.run + 1 };
            if self.run > NOISE_MAX {
                continue;
            }
            self.piece.push(*byte);
            // More than a frame and its leading delimiter is garbage and is sent without waiting.
            if *byte == 0 || self.piece.len() > FRAME_MAX {
                frames.push(std::mem::take(&mut self.piece));
            }
        }
        frames
    }

    fn is_within_frame(&self) -> bool {
        self.run > 0 && !self.piece.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn bytes_written_together_stay_together() {
        let (mut client, mut port) = TTYPort::pair().expect("a pty");
        port.set_timeout(LOOK).expect("a timeout");
        let (heard, commands) = channel();
        let unplugged = Arc::new(AtomicBool::new(false));
        let seen = unplugged.clone();
        let reader = thread::spawn(move || read(&mut port, &seen, &|command| heard.send(command).is_ok()));
        for parts in [&[[1, 2, 0, 3, 4, 0].as_slice()][..], &[&[1, 2, 0, 3], &[4, 0]]] {
            for part in parts {
                client.write_all(part).expect("room");
                thread::sleep(LOOK / 10); // the operating system may pause within a write
            }
            let bytes = commands.iter().find_map(|command| match command {
                Command::Bytes(bytes) => Some(bytes),
                _ => None,
            });
            assert_eq!(bytes, Some(vec![1, 2, 0, 3, 4, 0]));
        }
        // A frame that never ends delays others only briefly.
        client.write_all(&[5, 6, 0, 7]).expect("room");
        let first = commands.recv_timeout(10 * LOOK);
        assert!(matches!(first, Ok(Command::Bytes(bytes)) if bytes == [5, 6, 0]));
        unplugged.store(true, Ordering::Relaxed);
        reader.join().expect("an orderly end");
    }

    #[test]
    fn frames_stay_whole_and_garbage_passes() {
        let mut cutter = FrameCutter::default();
        assert!(cutter.cut(&[1, 2]).is_empty());
        assert_eq!(cutter.cut(&[3, 0, 4, 0, 5]), [vec![1, 2, 3, 0], vec![4, 0]]);
        let long = cutter.cut(&[7; FRAME_MAX]);
        assert_eq!((long.len(), long[0].len()), (1, FRAME_MAX + 1));
    }

    #[test]
    fn noise_without_a_delimiter_does_not_block_the_line() {
        for length in [1, FRAME_MAX, FRAME_MAX + 1, 2 * (FRAME_MAX + 1), 14_000, 1_000_000] {
            let mut cutter = FrameCutter::default();
            let noise: usize = cutter.cut(&vec![7; length]).iter().map(Vec::len).sum();
            assert!(noise <= NOISE_MAX, "{noise} of {length} bytes");
            // A request, which the noise spoils, and its repeat: both travel together.
            let pieces = cutter.cut(&[1, 2, 0]);
            assert_eq!(pieces.concat().last(), Some(&0), "{length}");
            assert_eq!(cutter.cut(&[0, 1, 2, 0]), [[0, 1, 2, 0]], "{length}");
        }
    }

    #[test]
    fn a_lone_delimiter_travels_with_the_next_frame() {
        let mut cutter = FrameCutter::default();
        assert!(cutter.cut(&[0]).is_empty());
        assert!(cutter.cut(&[0, 0]).is_empty());
        assert_eq!(cutter.cut(&[1, 2, 0, 0, 3, 0]), [vec![0, 1, 2, 0], vec![0, 3, 0]]);
        let mut longest = vec![9; FRAME_MAX];
        longest[FRAME_MAX - 1] = 0;
        assert!(cutter.cut(&[0]).is_empty());
        assert_eq!(cutter.cut(&longest), [[&[0], longest.as_slice()].concat()]);
    }
}
