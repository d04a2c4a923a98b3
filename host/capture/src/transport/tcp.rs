//! A board behind a TCP port: an emulated one (`farnear-sim run --tcp`), or the raw port of a serial server.

use std::{
    io::{self, Read, Write},
    net::{TcpStream, ToSocketAddrs},
    time::Duration,
};

use super::{Transport, send_all};
use crate::error::PortError;

/// Start of a port's name that means an address, `tcp:HOST:PORT`.
pub(crate) const SCHEME: &str = "tcp:";
const CONNECT: Duration = Duration::from_secs(2);

/// A TCP connection. It has no baud rate: a serial server sets that of its line.
pub struct TcpTransport {
    stream: TcpStream,
    name: String,
}

impl TcpTransport {
    /// Connects to `tcp:HOST:PORT`.
    pub fn open(name: &str) -> Result<Self, PortError> {
        let address = name.strip_prefix(SCHEME).unwrap_or(name);
        let failed = |error: io::Error| PortError::Connect { port: name.into(), reason: error.to_string() };
        let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        for address in address.to_socket_addrs().map_err(failed)? {
            match TcpStream::connect_timeout(&address, CONNECT) {
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(failed)?;
                    return Ok(Self { stream, name: name.into() });
                }
                Err(error) => last = error,
            }
        }
        Err(failed(last))
    }
}

/// Whether a read ended without progress.
fn is_timeout(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), TimedOut | WouldBlock | Interrupted)
}

impl Transport for TcpTransport {
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.stream.set_read_timeout(Some(wait.max(Duration::from_millis(1))))?;
        match self.stream.read(buffer) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(error) if is_timeout(&error) => Ok(0),
            other => other,
        }
    }

    fn send(&mut self, bytes: &[u8], wait: Duration) -> io::Result<()> {
        send_all(bytes, wait, |rest, left| {
            self.stream.set_write_timeout(Some(left))?;
            self.stream.write(rest)
        })
    }

    fn discard_input(&mut self) -> io::Result<()> {
        let mut bytes = [0; 4096];
        self.stream.set_nonblocking(true)?;
        let end = loop {
            match self.stream.read(&mut bytes) {
                Ok(0) => break Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(_) => {}
                Err(error) if is_timeout(&error) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        self.stream.set_nonblocking(false)?;
        end
    }

    fn port(&self) -> Option<&str> {
        Some(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use std::{net::TcpListener, time::Instant};

    use super::*;

    #[test]
    fn bytes_pass_and_the_end_of_the_other_side_is_an_error() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let name = format!("{SCHEME}{}", listener.local_addr().unwrap());
        let mut here = TcpTransport::open(&name).unwrap();
        let (mut there, _) = listener.accept().unwrap();
        let mut buffer = [0; 8];
        assert_eq!(here.receive(&mut buffer, Duration::from_millis(5)).unwrap(), 0, "a timeout");
        here.send(&[1, 2, 0], Duration::from_secs(1)).unwrap();
        there.read_exact(&mut buffer[..3]).unwrap();
        assert_eq!(buffer[..3], [1, 2, 0]);
        there.write_all(&[7; 20]).unwrap();
        assert!(here.receive(&mut buffer, Duration::from_secs(10)).unwrap() > 0);
        here.discard_input().unwrap();
        drop(there);
        let until = Instant::now() + Duration::from_secs(10);
        while here.receive(&mut buffer, Duration::from_millis(5)).is_ok() {
            assert!(Instant::now() < until, "the end was not noticed");
        }
    }

    #[test]
    fn an_address_without_a_board_is_named() {
        let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        for name in [format!("{SCHEME}{closed}"), format!("{SCHEME}127.0.0.1"), format!("{SCHEME}:x")] {
            let error = TcpTransport::open(&name).err().unwrap().to_string();
            assert!(error.contains(&name) && error.contains("tcp:HOST:PORT"), "{error}");
        }
    }
}
