use std::{
    io::{self, Read, Write},
    net::{Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::Receiver,
    },
    thread,
    time::{Duration, Instant},
};

use super::{End, LOOK, PATIENCE, read, spawn};
use crate::{command::Command, error::SimError};

/// Grace period in which a client that just disconnected may still appear connected.
const FAREWELL: Duration = Duration::from_millis(500);

struct Connection(TcpStream);

impl Read for Connection {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.0.read(buffer) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            other => other,
        }
    }
}

impl End for Connection {
    fn baud(&self) -> Option<u32> {
        None
    }

    fn survives(&self, _: &io::Error) -> bool {
        false
    }
}

/// Bytes that are kept for the first client, about as many as a pty keeps: the board's start and a scenario's garbage.
const EARLY_MAX: usize = 4096;

#[derive(Default)]
struct Client {
    stream: Option<TcpStream>,
    was_there: bool,
    early: Vec<u8>,
}

#[derive(Default)]
struct Line {
    client: Mutex<Client>,
    unplugged: AtomicBool,
}

impl Line {
    fn client(&self) -> MutexGuard<'_, Client> {
        self.client.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the last client leaves within the grace period.
    fn becomes_free(&self) -> bool {
        let until = Instant::now() + FAREWELL;
        while self.client().stream.is_some() {
            if Instant::now() > until {
                return false;
            }
            thread::sleep(LOOK / 10);
        }
        true
    }
}

pub(super) fn open(
    address: SocketAddr,
    to_client: Receiver<Vec<u8>>,
    from_client: impl Fn(Command) -> bool + Send + Sync + 'static,
) -> Result<String, SimError> {
    let failed = |source| SimError::Io { what: format!("cannot listen on {address}"), source };
    let listener = TcpListener::bind(address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let name = format!("tcp:{}", listener.local_addr().map_err(failed)?);
    let line = Arc::new(Line::default());
    let shared = line.clone();
    spawn("port out", move || {
        for bytes in to_client {
            let mut client = shared.client();
            if !client.was_there {
                let room = EARLY_MAX.saturating_sub(client.early.len());
                client.early.extend(bytes.iter().take(room));
            }
            let stream = client.stream.as_ref().and_then(|stream| stream.try_clone().ok());
            drop(client);
            // Without a client the bytes are lost.
            let _ = stream.map(|mut stream| stream.write_all(&bytes));
        }
        shared.unplugged.store(true, Ordering::Relaxed);
    })?;
    spawn("port in", move || accept(&listener, &line, &Arc::new(from_client)))?;
    Ok(name)
}

fn accept(
    listener: &TcpListener,
    line: &Arc<Line>,
    from_client: &Arc<impl Fn(Command) -> bool + Send + Sync + 'static>,
) {
    while !line.unplugged.load(Ordering::Relaxed) {
        let Ok((stream, _)) = listener.accept() else {
            thread::sleep(LOOK);
            continue;
        };
        if !line.becomes_free() {
            let _ = stream.shutdown(Shutdown::Both); // it may have gone already
            continue;
        }
        let (Ok(()), Ok(reader)) = (configure(&stream), stream.try_clone()) else { continue };
        let mut client = line.client();
        client.was_there = true;
        let _ = (&stream).write_all(&std::mem::take(&mut client.early)); // the client may have gone
        client.stream = Some(stream);
        drop(client);
        let (shared, from_client) = (line.clone(), from_client.clone());
        let work = move || {
            read(&mut Connection(reader), &shared.unplugged, &*from_client);
            if let Some(gone) = shared.client().stream.take() {
                let _ = gone.shutdown(Shutdown::Both); // the client may have done so
            }
        };
        if spawn("port client", work).is_err() {
            line.client().stream.take();
        }
    }
}

fn configure(stream: &TcpStream) -> io::Result<()> {
    stream.set_nonblocking(false)?; // some systems inherit it from the listener
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK))?;
    stream.set_write_timeout(Some(PATIENCE))
}

#[cfg(test)]
mod tests {
    use std::{net::Ipv4Addr, sync::mpsc::channel};

    use super::*;

    #[test]
    fn bytes_from_before_the_first_client_reach_it() {
        let (board, to_client) = channel();
        let name = open((Ipv4Addr::LOCALHOST, 0).into(), to_client, |_| true).expect("loopback");
        board.send(vec![1, 2]).expect("open");
        thread::sleep(LOOK);
        let mut client = TcpStream::connect(name.trim_start_matches("tcp:")).expect("it listens");
        client.set_read_timeout(Some(Duration::from_secs(20))).expect("a socket");
        let mut bytes = [0; 3];
        client.read_exact(&mut bytes[..2]).expect("without another byte of the board");
        board.send(vec![3]).expect("open");
        client.read_exact(&mut bytes[2..]).expect("the next byte");
        assert_eq!(bytes, [1, 2, 3]);
    }

    #[test]
    fn whole_frames_of_a_client_that_dies_within_another_arrive() {
        let (_board, to_client) = channel();
        let (heard, hear) = channel();
        let from_client = move |command| {
            let Command::Bytes(bytes) = command else { return true };
            heard.send(bytes).is_ok()
        };
        let name = open((Ipv4Addr::LOCALHOST, 0).into(), to_client, from_client).expect("loopback");
        let mut client = TcpStream::connect(name.trim_start_matches("tcp:")).expect("it listens");
        client.write_all(&[5, 0, 6]).expect("open");
        drop(client);
        assert_eq!(hear.recv_timeout(Duration::from_secs(20)), Ok(vec![5, 0]));
    }
}
