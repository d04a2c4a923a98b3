//! A session with a board: requests that are answered or fail, and events without a gap.
//!
//! A request is sent with an id and the board's boot number and sent again, byte for byte, until its answer
//! comes; the board acts once per id. Events carry running numbers; a gap is filled with
//! [`Request::ReadEvent`]. Garbage between frames is skipped. See `docs/protocol.md`.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use farnear_protocol::frame::{Kind, Packet};
use farnear_protocol::message::{EventKind, Hello, Status};
use farnear_protocol::{Event, Request, RequestError, Response};

use crate::error::ClientError;
use crate::handshake::shake_hands;
use crate::link::Link;
use crate::timing::Timing;
use crate::transport::{SerialTransport, Transport};

/// Longest single wait for an event, so that an interruption by the user is seen soon.
const SLICE: Duration = Duration::from_millis(100);
/// An event further ahead of the due one cannot come from a sane board, whose memory is smaller.
const AHEAD_MAX: u32 = 4096;

/// A session with a board.
pub struct Client {
    link: Link,
    version: u8,
    hello: Hello,
    timing: Timing,
    events: Events,
    interrupt: Option<Arc<AtomicBool>>,
}

/// The events of one boot, in order.
#[derive(Default)]
struct Events {
    boot: u32,
    /// Number of the event that is to be given out next.
    due: u32,
    /// What has arrived and was not given out.
    arrived: BTreeMap<u32, Event>,
}

impl Client {
    /// Opens a serial port and says hello.
    pub fn open(port: &str) -> Result<Self, ClientError> {
        Self::connect(Box::new(SerialTransport::open(port)?), port)
    }

    /// As [`Client::open`], where the board is known to be emulated: hello is asked as patiently as all else, so
    /// that a slow computer does not ask it twice, which would make the run another one.
    pub fn open_emulated(port: &str) -> Result<Self, ClientError> {
        Self::start(Box::new(SerialTransport::open(port)?), port, true)
    }

    /// Says hello over any transport. `port` is its name in messages.
    pub fn connect(transport: Box<dyn Transport>, port: &str) -> Result<Self, ClientError> {
        Self::start(transport, port, false)
    }

    fn start(transport: Box<dyn Transport>, port: &str, emulated: bool) -> Result<Self, ClientError> {
        let mut link = Link::new(transport, port);
        let (hello, version) = shake_hands(&mut link, emulated)?;
        let timing = if hello.emulated { Timing::EMULATED } else { Timing::REAL };
        let events = Events { boot: hello.boot, ..Events::default() };
        let mut client = Self { link, version, hello, timing, events, interrupt: None };
        client.join_events()?;
        Ok(client)
    }

    /// Says hello anew, after a reset of the board for instance. Events that were not read are forgotten.
    pub fn reopen(&mut self) -> Result<(), ClientError> {
        (self.hello, self.version) = shake_hands(&mut self.link, self.hello.emulated)?;
        self.events = Events { boot: self.hello.boot, ..Events::default() };
        self.join_events()
    }

    /// Events count from now on.
    fn join_events(&mut self) -> Result<(), ClientError> {
        let due = self.status()?.next_event;
        self.events.due = due;
        self.events.arrived.retain(|number, _| *number >= due);
        Ok(())
    }

    /// Who the board is.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// The protocol version of this session.
    pub fn protocol(&self) -> u8 {
        self.version
    }

    /// Name of the port.
    pub fn port(&self) -> &str {
        self.link.port()
    }

    /// The waiting times in use.
    pub fn timing(&self) -> Timing {
        self.timing
    }

    /// Uses other waiting times, for a test or an unusual line.
    pub fn set_timing(&mut self, timing: Timing) {
        self.timing = timing;
    }

    /// Once this flag becomes true, waiting for work ends: the board is told to stop and
    /// [`ClientError::Interrupted`] is returned.
    pub fn interrupt_by(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    pub(crate) fn interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// The flag of [`Client::interrupt_by`].
    pub(crate) fn interrupt_flag(&self) -> Option<Arc<AtomicBool>> {
        self.interrupt.clone()
    }

    /// Sends a request until its answer comes. `during` says what for, e.g. "homing". Gives the request's id,
    /// which events will name.
    pub fn request(&mut self, request: &Request, during: &str) -> Result<(u32, Response), ClientError> {
        let waits = vec![self.timing.reply; self.timing.retries as usize + 1];
        let address = (self.version, self.hello.boot);
        let events = &mut self.events;
        let (id, packet) =
            self.link.ask(address, request, &waits, during, &mut |packet| events.take(packet, during))?;
        let unreadable = || ClientError::Nonsense {
            during: during.into(),
            answer: format!("{:?} {:02x?}", packet.header.kind, packet.body.as_slice()),
        };
        if packet.header.kind == Kind::Response {
            return Ok((id, packet.message().ok_or_else(unreadable)?));
        }
        Err(match packet.message().ok_or_else(unreadable)? {
            RequestError::Boot { current } => {
                ClientError::Reset { during: during.into(), was: self.hello.boot, now: current, cause: None }
            }
            error => ClientError::Refused { during: during.into(), error },
        })
    }

    /// How the board is.
    pub fn status(&mut self) -> Result<Status, ClientError> {
        let during = "reading the status";
        match self.request(&Request::Status, during)? {
            (_, Response::Status(status)) => Ok(status),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// The next event, waiting at most `wait` for it; `None` where none came, or the user interrupted.
    pub fn next_event(&mut self, wait: Duration, during: &str) -> Result<Option<(u32, Event)>, ClientError> {
        let until = Instant::now() + wait;
        loop {
            if let Some(event) = self.events.pop() {
                return Ok(Some(event));
            }
            if !self.events.arrived.is_empty() {
                self.fetch_due_event(during)?;
                continue;
            }
            let now = Instant::now();
            if now >= until || self.interrupted() {
                return Ok(None);
            }
            if let Some(packet) = self.link.receive(until.min(now + SLICE), during)?
                && packet.header.kind == Kind::Event
            {
                self.events.take(&packet, during)?;
            }
        }
    }

    /// Whether an event lies ready.
    pub(crate) fn has_event_waiting(&self) -> bool {
        !self.events.arrived.is_empty()
    }

    /// Number of the event that is due next.
    pub(crate) fn due_event(&self) -> u32 {
        self.events.due
    }

    /// Asks the board for the due event, which did not arrive by itself.
    pub(crate) fn fetch_due_event(&mut self, during: &str) -> Result<(), ClientError> {
        let number = self.events.due;
        match self.request(&Request::ReadEvent { number }, during) {
            Ok((_, Response::Event(event))) => {
                self.events.arrived.insert(number, event);
                Ok(())
            }
            Ok((_, other)) => Err(nonsense(during, &other)),
            Err(ClientError::Refused { error: RequestError::EventGone { oldest, .. }, .. }) => {
                Err(ClientError::EventsLost {
                    during: during.into(),
                    from: number,
                    to: oldest.saturating_sub(1).max(number),
                })
            }
            Err(error) => Err(error),
        }
    }
}

impl Events {
    /// Keeps an event, unless it is old. An event of another boot means that the board was reset.
    fn take(&mut self, packet: &Packet, during: &str) -> Result<(), ClientError> {
        let event = packet.message::<Event>();
        if packet.header.boot != self.boot {
            let cause = match event {
                Some(Event { kind: EventKind::Started { cause }, .. }) => Some(cause),
                _ => None,
            };
            let (was, now) = (self.boot, packet.header.boot);
            return Err(ClientError::Reset { during: during.into(), was, now, cause });
        }
        let event = event.ok_or_else(|| ClientError::Nonsense {
            during: during.into(),
            answer: format!("event {:02x?}", packet.body.as_slice()),
        })?;
        if packet.header.id.wrapping_sub(self.due) < AHEAD_MAX {
            self.arrived.insert(packet.header.id, event);
        }
        Ok(())
    }

    fn pop(&mut self) -> Option<(u32, Event)> {
        let event = self.arrived.remove(&self.due)?;
        self.due += 1;
        Some((self.due - 1, event))
    }
}

/// An answer that is none to what was asked.
pub(crate) fn nonsense(during: &str, response: &Response) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: format!("{response:?}") }
}
