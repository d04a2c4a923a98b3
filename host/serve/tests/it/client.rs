//! A server, and a minimal HTTP and WebSocket client.

use std::{
    fmt::Write as _,
    fs,
    io::{Read, Write},
    net::TcpStream,
    path::{Path, PathBuf},
    sync::mpsc::channel,
    thread::JoinHandle,
    time::{Duration, Instant},
};

use farnear_scripted_board::{Faults, plug_in};
use farnear_serve::{Limits, Listen, ServeError, ServeSettings, serve, stopping::StopError};
use farnear_workflows::{
    Cancel, Context, Unattended,
    rig::{
        RigAddress,
        camera::{CameraAddress, CameraSettings},
    },
};
use serde_json::Value;

/// Longest wait for something that takes milliseconds on an idle computer.
const PATIENCE: Duration = Duration::from_secs(60);

/// A server without a rig, whose session is in this folder.
pub fn settings(folder: &Path, listen: Listen) -> ServeSettings {
    let shots = folder.join("shots");
    fs::create_dir_all(&shots).unwrap();
    let camera = CameraSettings {
        address: CameraAddress::Folder(shots),
        image_wait: Duration::from_secs(5),
        ..CameraSettings::default()
    };
    let (session, limits) = (folder.join("session"), Limits::default());
    ServeSettings { rig: None, camera, session, optics: None, listen, limits }
}

pub struct Served {
    pub address: String,
    pub session: PathBuf,
    cancel: Cancel,
    thread: Option<JoinHandle<()>>,
    folder: Option<tempfile::TempDir>,
    _board: Option<Box<dyn std::any::Any + Send + Sync>>,
}

impl Served {
    pub fn with_board(faults: Faults) -> Self {
        let (port, board) = plug_in(faults);
        Self::start(Some(RigAddress::Port(port)), Some(Box::new(board)), |_| Listen::Loopback { port: 0 })
    }

    /// The cookie with a token, as a browser sends it.
    pub fn cookie(&self, token: &str) -> String {
        let (_, port) = self.address.rsplit_once(':').unwrap();
        format!("farnear-token-{port}={token}")
    }

    pub fn captures_only() -> Self {
        Self::start(None, None, |_| Listen::Loopback { port: 0 })
    }

    pub fn start(
        rig: Option<RigAddress>,
        board: Option<Box<dyn std::any::Any + Send + Sync>>,
        listen: impl FnOnce(&Path) -> Listen,
    ) -> Self {
        Self::limited(rig, board, listen, Limits::default())
    }

    pub fn limited(
        rig: Option<RigAddress>,
        board: Option<Box<dyn std::any::Any + Send + Sync>>,
        listen: impl FnOnce(&Path) -> Listen,
        limits: Limits,
    ) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let listen = listen(folder.path());
        let settings = ServeSettings { rig, limits, ..settings(folder.path(), listen) };
        let session = settings.session.clone();
        let (cancel, (sender, address)) = (Cancel::default(), channel());
        let request = cancel.clone();
        let thread = std::thread::spawn(move || {
            let context = Context::new(&Unattended, &Unattended, request);
            let served = serve(settings, &context, |address| sender.send(address.to_owned()).unwrap());
            // A server whose board is silent reports it at its end.
            assert!(matches!(served, Ok(()) | Err(ServeError::Stop(StopError::Unanswered))), "{served:?}");
        });
        let address = address.recv_timeout(PATIENCE).unwrap();
        let address = address.trim_start_matches("http://").trim_end_matches('/').to_owned();
        Self { address, session, cancel, thread: Some(thread), folder: Some(folder), _board: board }
    }

    /// Stops the server and returns the folder that holds its session.
    pub fn stop(mut self) -> tempfile::TempDir {
        self.folder.take().unwrap()
    }

    /// Sends only these bytes and returns the whole answer.
    pub fn raw(&self, bytes: &[u8]) -> Vec<u8> {
        self.exchange(bytes, true)
    }

    /// Sends these bytes and returns the whole answer. The server takes the end of a stream for a disconnected client.
    pub fn exchange(&self, bytes: &[u8], ends: bool) -> Vec<u8> {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let _ = stream.write_all(bytes); // it may refuse to hear more
        if ends {
            let _ = stream.shutdown(std::net::Shutdown::Write);
        }
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer); // a connection that is reset has answered as well
        answer
    }

    pub fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let mut request = format!("{method} {path} HTTP/1.1\r\nconnection: close\r\n");
        if !headers.iter().any(|(name, _)| name.eq_ignore_ascii_case("host")) {
            let _ = write!(request, "host: {}\r\n", self.address);
        }
        for (name, value) in headers {
            let _ = write!(request, "{name}: {value}\r\n");
        }
        if method != "GET" {
            let _ = write!(request, "content-type: application/json\r\ncontent-length: {}\r\n", body.len());
        }
        let _ = write!(request, "\r\n{body}");
        Answer::parse(&self.exchange(request.as_bytes(), false))
    }

    pub fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, &[], "")
    }

    pub fn post(&self, path: &str, client: &str, body: &str) -> Answer {
        self.ask("POST", path, &[("x-farnear-client", client)], body)
    }

    /// The state as soon as `fits` holds.
    pub fn state_when(&self, fits: impl Fn(&Value) -> bool) -> Value {
        let until = Instant::now() + PATIENCE;
        loop {
            let state = self.get("/api/state").json();
            if fits(&state) {
                return state;
            }
            assert!(Instant::now() < until, "{state:#}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// The state with a rig that answers.
    pub fn ready(&self) -> Value {
        self.state_when(|state| state["rig"]["phase"] == "ready")
    }

    /// The job with this number after its end.
    pub fn ended(&self, queue: &str, job: &Value) -> Value {
        let state = self.state_when(|state| state[queue]["id"] == *job && state[queue]["phase"] != "running");
        state[queue].clone()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.cancel.cancel();
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking());
    }
}

#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub headers: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn parse(bytes: &[u8]) -> Self {
        let split = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap_or(bytes.len());
        let headers = String::from_utf8_lossy(&bytes[..split]).into_owned();
        let status = headers.split(' ').nth(1).and_then(|text| text.parse().ok()).unwrap_or(0);
        let body = &bytes[(split + 4).min(bytes.len())..];
        let chunked = headers.to_ascii_lowercase().contains("transfer-encoding: chunked");
        let body = if chunked { unchunked(body) } else { body.to_vec() };
        Self { status, headers, body }
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    pub fn error(&self) -> String {
        self.json()["error"].as_str().unwrap_or_default().to_owned()
    }
}

fn unchunked(mut rest: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    while let Some(end) = rest.windows(2).position(|two| two == b"\r\n") {
        let size =
            std::str::from_utf8(&rest[..end]).ok().and_then(|text| usize::from_str_radix(text, 16).ok());
        let Some(size) = size.filter(|size| *size > 0) else { break };
        let from = end + 2;
        body.extend(&rest[from..(from + size).min(rest.len())]);
        rest = rest.get(from + size + 2..).unwrap_or_default();
    }
    body
}

/// A WebSocket client (RFC 6455), as far as tests need it.
pub struct Socket {
    stream: TcpStream,
    pub client: u64,
    pub secret: String,
}

impl Socket {
    pub fn open(served: &Served) -> Self {
        Self::at(served, "/api/socket", "")
    }

    /// As [`Self::open`], with the cookie that a server on the network asks for.
    pub fn with_cookie(served: &Served, cookie: &str) -> Self {
        Self::at(served, "/api/socket", &format!("cookie: {cookie}\r\n"))
    }

    /// A reloaded page with its earlier secret.
    pub fn resume(served: &Served, secret: &str) -> Self {
        Self::at(served, &format!("/api/socket?resume={secret}"), "")
    }

    fn at(served: &Served, path: &str, headers: &str) -> Self {
        let mut stream = TcpStream::connect(&served.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let request = format!(
            "GET {path} HTTP/1.1\r\nhost: {}\r\nconnection: upgrade\r\nupgrade: websocket\r\n\
             sec-websocket-version: 13\r\nsec-websocket-key: AAAAAAAAAAAAAAAAAAAAAA==\r\n{headers}\r\n",
            served.address
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut headers = Vec::new();
        while !headers.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            headers.push(byte[0]);
        }
        assert!(headers.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&headers));
        let mut socket = Self { stream, client: 0, secret: String::new() };
        let hello = socket.receive("hello");
        socket.client = hello["hello"]["client"].as_u64().unwrap();
        socket.secret = hello["hello"]["secret"].as_str().unwrap().into();
        socket
    }

    /// The next text message of this type.
    pub fn receive(&mut self, kind: &str) -> Value {
        loop {
            let (opcode, payload) = self.frame().unwrap();
            if opcode == 1 {
                let value: Value = serde_json::from_slice(&payload).unwrap();
                if value["type"] == kind {
                    return value;
                }
            }
        }
    }

    fn frame(&mut self) -> std::io::Result<(u8, Vec<u8>)> {
        let mut head = [0; 2];
        self.stream.read_exact(&mut head)?;
        let length = match head[1] & 127 {
            126 => {
                let mut bytes = [0; 2];
                self.stream.read_exact(&mut bytes)?;
                usize::from(u16::from_be_bytes(bytes))
            }
            127 => {
                let mut bytes = [0; 8];
                self.stream.read_exact(&mut bytes)?;
                usize::try_from(u64::from_be_bytes(bytes)).unwrap()
            }
            short => usize::from(short),
        };
        let mut payload = vec![0; length];
        self.stream.read_exact(&mut payload)?;
        Ok((head[0] & 15, payload))
    }

    /// Sends a frame of at most 125 bytes, with a mask of zeros.
    pub fn say(&mut self, opcode: u8, payload: &[u8]) {
        assert!(payload.len() < 126);
        let mut frame = vec![0x80 | opcode, 0x80 | payload.len() as u8, 0, 0, 0, 0];
        frame.extend(payload);
        let _ = self.stream.write_all(&frame); // the other end may have gone, which is what some tests want
    }
}
