//! Camera endpoint: sends frames and receives control messages on loopback TCP. Accepts one client; others
//! receive [`IN_USE`]. Each frame is sent once; frames left by a client are dropped, and its free run ends.

use std::{
    collections::VecDeque,
    io::{Read, Write},
    net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::{Arc, Condvar, Mutex, PoisonError, mpsc::Receiver},
    thread,
    time::Duration,
};

use farnear_protocol::{
    camera::{Control, IN_USE},
    units::Micros,
};

use crate::error::SimError;

/// Frames kept until a client connects.
const WAITING: usize = 32;
/// Frames kept for a connected client.
const AHEAD: usize = 2;
/// Maximum control message; real ones are far shorter.
const CONTROL_MAX: u32 = 64;
/// Grace period in which a client that just disconnected may still appear connected.
const FAREWELL: Duration = Duration::from_millis(500);

struct Client {
    /// Tells clients apart: after a reset the system no longer reports the peer.
    number: u64,
    stream: TcpStream,
    /// It has started a free run and not ended it.
    runs_freely: bool,
}

#[derive(Default)]
struct State {
    frames: VecDeque<Vec<u8>>,
    client: Option<Client>,
}

struct Endpoint {
    state: Mutex<State>,
    changed: Condvar,
    control: Box<dyn Fn(Control) + Send + Sync>,
    left: Box<dyn Fn() + Send + Sync>,
}

type Shared = Arc<Endpoint>;

fn lock(shared: &Shared) -> std::sync::MutexGuard<'_, State> {
    shared.state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens a free loopback port. `frames` go to the client, its messages to `control`; then calls `left`.
pub fn open(
    frames: Receiver<Vec<u8>>,
    control: impl Fn(Control) + Send + Sync + 'static,
    left: impl Fn() + Send + Sync + 'static,
) -> Result<SocketAddr, SimError> {
    let io = |what: &str| {
        let what = what.to_string();
        move |source| SimError::Io { what, source }
    };
    let listener =
        TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(io("cannot open the camera endpoint"))?;
    let address = listener.local_addr().map_err(io("cannot open the camera endpoint"))?;
    let shared: Shared = Arc::new(Endpoint {
        state: Mutex::default(),
        changed: Condvar::new(),
        control: Box::new(control),
        left: Box::new(left),
    });
    let spawn = |name: &str, work: Box<dyn FnOnce() + Send>| {
        thread::Builder::new().name(name.into()).spawn(work).map_err(io("cannot start a thread"))
    };
    let state = shared.clone();
    spawn("camera clients", Box::new(move || accept(&listener, &state)))?;
    let state = shared.clone();
    spawn("camera frames", Box::new(move || keep(frames, &state)))?;
    spawn("camera sender", Box::new(move || send(&shared)))?;
    Ok(address)
}

fn accept(listener: &TcpListener, shared: &Shared) {
    for (number, stream) in (0..).zip(listener.incoming()) {
        let Ok(stream) = stream else { continue };
        let (Ok(reader), Ok(())) = (stream.try_clone(), stream.set_nodelay(true)) else { continue };
        let taken = |state: &mut State| state.client.is_some();
        let waited = shared.changed.wait_timeout_while(lock(shared), FAREWELL, taken);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if state.client.is_some() {
            drop(state);
            refuse(stream);
            continue;
        }
        state.client = Some(Client { number, stream, runs_freely: false });
        drop(state);
        shared.changed.notify_all();
        let shared = shared.clone();
        // Without a reader thread the client still gets its frames.
        let _ = thread::Builder::new().name("camera control".into()).spawn(move || {
            listen(reader, &|message| obey(&shared, number, message));
            forget(&shared, number);
        });
    }
}

fn refuse(mut stream: TcpStream) {
    let _ = stream.write_all(&IN_USE.to_le_bytes()); // it may have gone already
    let _ = stream.shutdown(Shutdown::Both);
}

/// Ignores a client that is forgotten: some of its messages may still wait to be read.
fn obey(shared: &Shared, number: u64, message: Control) {
    let mut state = lock(shared);
    let Some(client) = state.client.as_mut().filter(|client| client.number == number) else { return };
    if let Control::FreeRun { period, .. } = message {
        client.runs_freely = period.0 > 0;
    }
    (shared.control)(message);
}

/// Ends the client's free run before another client may start one.
fn forget(shared: &Shared, gone: u64) {
    let mut state = lock(shared);
    if let Some(client) = state.client.take_if(|client| client.number == gone) {
        state.frames.clear();
        // As a GigE Vision camera without heartbeat; one that runs freely ignores triggers.
        if client.runs_freely {
            (shared.control)(Control::FreeRun { period: Micros(0), exposure: Micros(0) });
        }
        (shared.left)();
        let _ = client.stream.shutdown(Shutdown::Both); // a client may wait for this
        shared.changed.notify_all();
    }
}

/// Reads control messages until the client disconnects or sends an invalid one.
fn listen(mut reader: TcpStream, control: &impl Fn(Control)) {
    let mut length = [0; 4];
    while reader.read_exact(&mut length).is_ok() {
        let length = u32::from_le_bytes(length);
        if length > CONTROL_MAX {
            eprintln!(
                "camera endpoint: a control message of {length} bytes, at most {CONTROL_MAX} are expected"
            );
            let _ = reader.shutdown(Shutdown::Both);
            return;
        }
        let mut body = vec![0; length as usize];
        if reader.read_exact(&mut body).is_err() {
            return;
        }
        match postcard::from_bytes(&body) {
            Ok(message) => control(message),
            Err(error) => eprintln!("camera endpoint: invalid control message: {error}"),
        }
    }
}

fn keep(frames: Receiver<Vec<u8>>, shared: &Shared) {
    for frame in frames {
        let full = |state: &mut State| state.frames.len() >= AHEAD && state.client.is_some();
        let mut state = shared.changed.wait_while(lock(shared), full).unwrap_or_else(PoisonError::into_inner);
        if state.frames.len() >= WAITING {
            state.frames.pop_front();
        }
        state.frames.push_back(frame);
        shared.changed.notify_all();
    }
}

fn send(shared: &Shared) {
    loop {
        let mut state = lock(shared);
        while state.frames.is_empty() || state.client.is_none() {
            state = shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        let frame = state.frames.pop_front();
        shared.changed.notify_all();
        let client = state.client.as_ref().map(|client| (client.number, client.stream.try_clone()));
        drop(state);
        let (Some(frame), Some((number, Ok(mut client)))) = (frame, client) else { continue };
        if client.write_all(&frame).is_err() {
            forget(shared, number);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    const LONG: Duration = Duration::from_secs(20);

    fn tell(client: &mut TcpStream, control: Control) {
        let mut body = [0; 16];
        let body = postcard::to_slice(&control, &mut body).expect("fits");
        client.write_all(&(body.len() as u32).to_le_bytes()).expect("open");
        client.write_all(body).expect("open");
    }

    fn connect(address: SocketAddr) -> TcpStream {
        let client = TcpStream::connect(address).expect("loopback");
        client.set_read_timeout(Some(LONG)).expect("a socket");
        client
    }

    #[test]
    fn frames_wait_for_a_client_and_control_messages_arrive() {
        let (frames, receiver) = mpsc::channel();
        let (heard, hear) = mpsc::channel();
        let (gone, goes) = mpsc::channel();
        let left = move || {
            let _ = gone.send(()); // the receiver may have gone
        };
        let address =
            open(receiver, move |message| heard.send(message).expect("heard"), left).expect("loopback");
        frames.send(vec![1, 2, 3]).expect("open");
        let mut client = connect(address);
        frames.send(vec![4]).expect("open");
        let mut bytes = [0; 4];
        client.read_exact(&mut bytes).expect("both frames");
        assert_eq!(bytes, [1, 2, 3, 4]);

        tell(&mut client, Control::AdvanceMicros(1234));
        assert_eq!(hear.recv_timeout(LONG), Ok(Control::AdvanceMicros(1234)));

        // A second client is refused; the first is not disturbed.
        let mut second = connect(address);
        second.read_exact(&mut bytes).expect("a refusal");
        assert_eq!(u32::from_le_bytes(bytes), IN_USE);
        assert_eq!(second.read(&mut bytes).expect("closed in order"), 0);
        frames.send(vec![9]).expect("open");
        client.read_exact(&mut bytes[..1]).expect("the frame");
        assert_eq!(bytes[0], 9);
        // The next client is accepted after the first has left.
        client.shutdown(Shutdown::Write).expect("open");
        goes.recv_timeout(LONG).expect("told");
        assert_eq!(client.read(&mut bytes).expect("closed in order"), 0);
        let mut third = connect(address);
        frames.send(vec![7]).expect("open");
        third.read_exact(&mut bytes[..1]).expect("the frame");
        assert_eq!(bytes[0], 7);
    }

    #[test]
    fn the_free_run_of_a_client_that_vanishes_ends() {
        let (_frames, receiver) = mpsc::channel();
        let (heard, hear) = mpsc::channel();
        let address =
            open(receiver, move |message| heard.send(message).expect("heard"), || {}).expect("loopback");
        let run = |period| Control::FreeRun { period: Micros(period), exposure: Micros(5_000) };
        let mut client = connect(address);
        tell(&mut client, run(40_000));
        drop(client);
        assert_eq!(hear.recv_timeout(LONG), Ok(run(40_000)));
        let end = hear.recv_timeout(LONG);
        assert!(matches!(end, Ok(Control::FreeRun { period: Micros(0), .. })), "{end:?}");
        // A client that has ended it leaves a free run of another program alone.
        let mut client = connect(address);
        tell(&mut client, run(40_000));
        tell(&mut client, run(0));
        drop(client);
        tell(&mut connect(address), Control::AdvanceMicros(1));
        let rest: Vec<_> = (0..3).map(|_| hear.recv_timeout(LONG)).collect();
        assert_eq!(rest, [Ok(run(40_000)), Ok(run(0)), Ok(Control::AdvanceMicros(1))]);
    }

    #[test]
    fn the_free_run_of_a_forgotten_client_ends_before_the_next_one_begins() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("loopback");
        let address = listener.local_addr().expect("a socket");
        let (heard, hear) = mpsc::channel();
        let control = move |message: Control| {
            let _ = heard.send(message); // the receiver may have gone
        };
        let shared: Shared = Arc::new(Endpoint {
            state: Mutex::default(),
            changed: Condvar::new(),
            control: Box::new(control),
            left: Box::new(|| {}),
        });
        let accepting = shared.clone();
        thread::spawn(move || accept(&listener, &accepting));
        let run = |period| Control::FreeRun { period: Micros(period), exposure: Micros(5_000) };
        let mut first = connect(address);
        tell(&mut first, run(40_000));
        assert_eq!(hear.recv_timeout(LONG), Ok(run(40_000)));
        // The sender notices before the reader that the client has left.
        forget(&shared, 0);
        let end = hear.try_recv();
        assert!(matches!(end, Ok(Control::FreeRun { period: Micros(0), .. })), "{end:?}");
        tell(&mut connect(address), run(50_000));
        assert_eq!(hear.recv_timeout(LONG), Ok(run(50_000)));
    }
}
