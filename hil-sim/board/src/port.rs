//! The port that clients open: a pty, or a TCP port. Forwards client bytes in whole frames. Bytes written together
//! stay together: later ones would reach the board in another state.

#[cfg(unix)]
mod pty;
mod tcp;

use std::{
    io::{self, ErrorKind, Read},
    net::SocketAddr,
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::Receiver,
    },
    thread,
    time::Duration,
};

use farnear_protocol::frame::FRAME_MAX;

use crate::{command::Command, error::SimError};

/// Read timeout: interval of checks for an unplugged port, and of whole frames waiting for an incomplete one.
const LOOK: Duration = Duration::from_millis(20);
/// A client that reads nothing for this long loses bytes, as on a real line.
const PATIENCE: Duration = Duration::from_millis(500);

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PortKind {
    /// A pseudo-terminal, which clients open as a serial port.
    #[cfg(unix)]
    Pty,
    /// One client at a time; further ones are disconnected.
    Tcp(SocketAddr),
}

impl PortKind {
    /// Opens the port and returns its name. Whole frames and changed baud rates go to `from_client`, which returns
    /// whether it accepts more. The port closes when `to_client` ends.
    pub fn open(
        self,
        to_client: Receiver<Vec<u8>>,
        from_client: impl Fn(Command) -> bool + Send + Sync + 'static,
    ) -> Result<String, SimError> {
        match self {
            #[cfg(unix)]
            Self::Pty => pty::open(to_client, from_client),
            Self::Tcp(address) => tcp::open(address, to_client, from_client),
        }
    }

    /// The port of a board that is plugged in again: another pty, or another TCP port of that interface.
    pub(crate) fn another(self) -> Self {
        match self {
            Self::Tcp(address) => Self::Tcp(SocketAddr::new(address.ip(), 0)),
            #[cfg(unix)]
            Self::Pty => Self::Pty,
        }
    }
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), SimError> {
    let started = thread::Builder::new().name(name.into()).spawn(work);
    started.map(drop).map_err(|source| SimError::Io { what: "cannot start the port's thread".into(), source })
}

/// The emulator's end of a line.
trait End: Read {
    /// The client's baud rate, if the line has one.
    fn baud(&self) -> Option<u32>;

    /// Whether a client may come back after this error.
    fn survives(&self, error: &io::Error) -> bool;
}

/// Forwards a client's input until the port is unplugged, its line ends, or `from_client` accepts no more.
fn read(end: &mut impl End, unplugged: &AtomicBool, from_client: &impl Fn(Command) -> bool) {
    let mut cutter = FrameCutter::default();
    let mut bytes = [0; 4096];
    let mut rate = None;
    let mut frames = Vec::new();
    while !unplugged.load(Ordering::Relaxed) {
        let rest_may_come = match end.read(&mut bytes) {
            Ok(count) => {
                let now = end.baud();
                if now != rate && !now.is_some_and(|baud| from_client(Command::HostRate(baud))) {
                    return;
                }
                rate = now;
                frames.extend(cutter.cut(&bytes[..count]).concat());
                cutter.is_within_frame()
            }
            Err(error) => {
                use ErrorKind::{Interrupted, TimedOut, WouldBlock};
                if !matches!(error.kind(), TimedOut | WouldBlock | Interrupted) {
                    if !end.survives(&error) {
                        // The whole frames in front of one that the client never finished.
                        if !frames.is_empty() {
                            from_client(Command::Bytes(frames));
                        }
                        return;
                    }
                    thread::sleep(LOOK);
                }
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
    use super::*;

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
