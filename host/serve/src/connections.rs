//! Time-outs and limits against slow, silent or too many clients. Above a limit the oldest connection without a request
//! is closed, then the oldest idle one.

use std::{
    collections::VecDeque,
    io,
    net::{IpAddr, SocketAddr},
    pin::Pin,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering},
    },
    task::{Context, Poll, Waker, ready},
    time::Duration,
};

use axum::{
    extract::connect_info::Connected,
    serve::{IncomingStream, Listener},
};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    time::{Instant, Sleep, sleep_until},
};

use crate::app::{App, lock};

/// Descriptors reserved for captures, the camera and the rig.
const RESERVED_DESCRIPTORS: usize = 128;
const RETRY: Duration = Duration::from_millis(100);
const LOG_INTERVAL: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Longest time from the first byte of a request, or from the connection, to the end of its headers.
    pub header_timeout: Duration,
    /// Longest time for a JSON body, and longest pause within an upload.
    pub body_timeout: Duration,
    /// Longest time without a request on an open connection, and longest time in which a client takes no byte of an answer.
    pub idle_timeout: Duration,
    /// Most connections; fewer if the system allows this process fewer than this plus 128 descriptors.
    pub connections: usize,
    pub connections_per_address: usize,
    /// Most bytes of uploaded videos in a session.
    pub upload_quota_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            header_timeout: Duration::from_secs(10),
            body_timeout: Duration::from_secs(20),
            idle_timeout: Duration::from_secs(30),
            connections: 512,
            connections_per_address: 128,
            upload_quota_bytes: 2 << 30,
        }
    }
}

/// [`WAITING`]: no request yet; [`SERVING`]: a request is being answered; [`IDLE`]: between requests; [`UPGRADED`]: a
/// WebSocket, which has its own time-outs.
const WAITING: u8 = 0;
const IDLE: u8 = 1;
const SERVING: u8 = 2;
const UPGRADED: u8 = 3;

#[derive(Debug)]
pub struct Connection {
    address: IpAddr,
    phase: AtomicU8,
    requests: AtomicUsize,
    evicted: AtomicBool,
    waker: Mutex<Option<Waker>>,
}

impl Connection {
    pub fn address(&self) -> IpAddr {
        self.address
    }

    pub fn begin_request(&self) {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.phase.store(SERVING, Ordering::Relaxed);
    }

    /// The answer is ready: bytes read from now on belong to the next request.
    pub fn end_request(&self) {
        self.phase.store(IDLE, Ordering::Relaxed);
    }

    pub fn upgrade(&self) {
        self.phase.store(UPGRADED, Ordering::Relaxed);
    }

    fn phase(&self) -> u8 {
        self.phase.load(Ordering::Relaxed)
    }

    fn evict(&self) {
        self.evicted.store(true, Ordering::Relaxed);
        if let Some(waker) = lock(&self.waker).take() {
            waker.wake();
        }
    }
}

#[derive(Clone, Debug)]
pub struct Peer(pub Arc<Connection>);

impl Connected<IncomingStream<'_, LimitedListener>> for Peer {
    fn connect_info(stream: IncomingStream<'_, LimitedListener>) -> Self {
        Self(Arc::clone(&stream.io().connection))
    }
}

pub struct LimitedListener {
    listener: TcpListener,
    app: Arc<App>,
    limits: Limits,
    open: Arc<Mutex<VecDeque<Arc<Connection>>>>,
    closed: usize,
    logged: Option<Instant>,
}

impl LimitedListener {
    pub fn new(listener: TcpListener, app: Arc<App>) -> Self {
        let mut limits = app.limits;
        if let Some(descriptors) = open_files() {
            limits.connections =
                limits.connections.min(descriptors.saturating_sub(RESERVED_DESCRIPTORS)).max(16);
        }
        Self { listener, app, limits, open: Arc::default(), closed: 0, logged: None }
    }

    /// Makes room for a connection of `address`; `false` if every connection that counts is in use.
    fn make_room(&mut self, address: IpAddr) -> bool {
        let mut open = lock(&self.open);
        let of_address = open.iter().filter(|other| other.address == address).count();
        let crowded = of_address >= self.limits.connections_per_address;
        if !crowded && open.len() < self.limits.connections {
            return true;
        }
        let candidate = [WAITING, IDLE].into_iter().find_map(|phase| {
            open.iter().position(|other| other.phase() == phase && (!crowded || other.address == address))
        });
        self.closed += 1;
        let evicted = candidate.and_then(|at| open.remove(at));
        if let Some(connection) = &evicted {
            connection.evict();
        }
        drop(open);
        self.report(address, crowded);
        evicted.is_some()
    }

    fn report(&mut self, address: IpAddr, crowded: bool) {
        if self.logged.is_some_and(|logged| logged.elapsed() < LOG_INTERVAL) {
            return;
        }
        self.logged = Some(Instant::now());
        let Limits { connections, connections_per_address, .. } = self.limits;
        let limit = match crowded {
            true => format!("{address} has {connections_per_address} connections"),
            false => format!("{connections} connections are open"),
        };
        self.app.note(format!("warning: {limit}, the limit: {} idle ones were closed", self.closed));
    }
}

impl Listener for LimitedListener {
    type Io = LimitedStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            let (stream, address) = match self.listener.accept().await {
                Ok(accepted) => accepted,
                Err(error) => {
                    if self.logged.is_none_or(|logged| logged.elapsed() >= LOG_INTERVAL) {
                        self.logged = Some(Instant::now());
                        self.app.note(format!("warning: cannot accept a connection: {error}"));
                    }
                    tokio::time::sleep(RETRY).await;
                    continue;
                }
            };
            if !self.make_room(address.ip()) {
                continue;
            }
            let _ = stream.set_nodelay(true); // only a matter of delay
            let connection = Arc::new(Connection {
                address: address.ip(),
                phase: AtomicU8::new(WAITING),
                requests: AtomicUsize::new(0),
                evicted: AtomicBool::new(false),
                waker: Mutex::default(),
            });
            lock(&self.open).push_back(Arc::clone(&connection));
            let now = Instant::now();
            let stream = LimitedStream {
                stream,
                connection,
                open: Arc::clone(&self.open),
                limits: self.limits,
                request_began: Some(now),
                requests: 0,
                active: now,
                timer: Box::pin(sleep_until(now)),
            };
            return (stream, address);
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.listener.local_addr()
    }
}

/// Ends at its deadline.
pub struct LimitedStream {
    stream: TcpStream,
    connection: Arc<Connection>,
    open: Arc<Mutex<VecDeque<Arc<Connection>>>>,
    limits: Limits,
    /// From the first byte of a request to the end of its headers.
    request_began: Option<Instant>,
    requests: usize,
    active: Instant,
    timer: Pin<Box<Sleep>>,
}

impl LimitedStream {
    /// Returns an error at `deadline`, or when the connection is evicted.
    fn poll_deadline(&mut self, cx: &mut Context<'_>, deadline: Option<Instant>) -> Poll<io::Error> {
        *lock(&self.connection.waker) = Some(cx.waker().clone());
        if self.connection.evicted.load(Ordering::Relaxed) {
            return Poll::Ready(io::ErrorKind::ConnectionAborted.into());
        }
        let Some(deadline) = deadline else { return Poll::Pending };
        if self.timer.deadline() != deadline {
            self.timer.as_mut().reset(deadline);
        }
        ready!(self.timer.as_mut().poll(cx));
        Poll::Ready(io::ErrorKind::TimedOut.into())
    }

    /// Returns an error if the client takes no byte before the idle time-out.
    fn wrote(&mut self, cx: &mut Context<'_>, written: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        if written.is_ready() {
            self.active = Instant::now();
            return written;
        }
        let deadline = self.active + self.limits.idle_timeout;
        self.poll_deadline(cx, Some(deadline)).map(Err)
    }
}

impl Drop for LimitedStream {
    fn drop(&mut self) {
        lock(&self.open).retain(|other| !Arc::ptr_eq(other, &self.connection));
    }
}

impl AsyncRead for LimitedStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let requests = self.connection.requests.load(Ordering::Relaxed);
        if requests != self.requests {
            (self.requests, self.request_began) = (requests, None);
        }
        let read = Pin::new(&mut self.stream).poll_read(cx, buffer);
        let phase = self.connection.phase();
        if read.is_ready() && buffer.filled().len() > before {
            self.active = Instant::now();
            if phase == IDLE {
                let active = self.active;
                self.request_began.get_or_insert(active);
            }
        }
        let deadline = match (phase, self.request_began) {
            (SERVING | UPGRADED, _) => None,
            (_, Some(began)) => Some(began + self.limits.header_timeout),
            (_, None) => Some(self.active + self.limits.idle_timeout),
        };
        // Checked while bytes arrive, too: slow headers have the same deadline.
        match self.poll_deadline(cx, deadline) {
            Poll::Ready(error) => Poll::Ready(Err(error)),
            Poll::Pending => read,
        }
    }
}

impl AsyncWrite for LimitedStream {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.wrote(cx, written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(cx, parts);
        self.wrote(cx, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

/// The soft limit of open files; `None` where the system does not report it.
fn open_files() -> Option<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    line.split_whitespace().next()?.parse().ok()
}
