//! Handle of a board: requests, and streams of events and logs. A request is repeated byte for byte until its
//! answer comes; the board acts once per id. Handles can be cloned and used from any thread; one thread owns
//! the port and sends requests in sequence. A handle belongs to one session. After a reset or unplugging each
//! request fails with [`ClientError::Reset`] or [`ClientError::Gone`] until [`Client::reopen`], because the
//! rig may have lost its position. See `docs/protocol.md`.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{RecvTimeoutError, Sender, channel, sync_channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use farnear_protocol::{
    Request, Response,
    message::{Axis, Hello, LightLevels, LinkRate, Status},
};

use crate::{
    error::ClientError,
    log_stream::LogStream,
    owner::{Answered, Command, Connect, Held, Listener, Owner, Question, Session, nonsense, nothing},
    timing::{Pace, Timing},
    transport::{Place, with_rate},
};

const INTERRUPT_POLL: Duration = Duration::from_millis(25);
/// Time to wait for an answer after an interruption.
const ANSWER_GRACE: Duration = Duration::from_millis(150);
const NEXT_ATTEMPT: Duration = Duration::from_millis(50);

#[derive(Clone)]
pub struct Client {
    port: Arc<Port>,
    session: Session,
    interrupt: Option<Arc<AtomicBool>>,
    /// Light of the shots that the board triggers.
    light: Option<LightLevels>,
    /// Whether every second shot is without light.
    alternating: bool,
}

/// Cached settings of the board on which timeouts depend.
#[derive(Default)]
pub(crate) struct Known {
    pub paces: Vec<(Axis, Pace)>,
    pub readout: Option<Duration>,
}

/// Channel to the port's thread, which ends with the last handle.
struct Port {
    name: String,
    timing: Arc<Mutex<Timing>>,
    wanted: Option<LinkRate>,
    known: Mutex<Known>,
    held: Held,
    inbox: Option<Sender<Command>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Port {
    fn drop(&mut self) {
        drop(self.inbox.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // it never panics; pending output is sent now
        }
    }
}

impl Client {
    /// Opens a serial port, or `tcp:HOST:PORT`, and says hello. An unplugged board is reconnected when it returns. `/dev/ttyACM0@921600`
    /// requests a link rate; without it on both ends the link keeps its rate, see [`Client::link_note`].
    pub fn open(port: &str) -> Result<Self, ClientError> {
        let (port, wanted) = with_rate(port)?;
        Self::start(serial(port), port, false, wanted)
    }

    /// As [`Client::open`] for a stop or a halt, which a change of the link rate would delay: says hello at the port's
    /// rate first, and keeps the board's.
    pub fn open_to_stop(port: &str) -> Result<Self, ClientError> {
        let (port, first) = with_rate(port)?;
        Self::start_at(serial(port), port, false, (first, None), None)
    }

    /// As [`Client::open`] or [`Client::open_emulated`], interrupted by this flag ([`Client::interrupt_by`]) from the
    /// beginning: once it is set, this returns [`ClientError::Interrupted`] and the port is closed.
    pub fn open_interruptible(
        port: &str,
        emulated: bool,
        interrupt: Arc<AtomicBool>,
    ) -> Result<Self, ClientError> {
        let (port, wanted) = with_rate(port)?;
        Self::start_at(serial(port), port, emulated, (wanted, wanted), Some(interrupt))
    }

    /// As [`Client::open`] for an emulated board: hello has a long timeout, because a repeat would change the run.
    pub fn open_emulated(port: &str) -> Result<Self, ClientError> {
        Self::start(serial(port), port, true, None)
    }

    /// Says hello over `connect`, initially and after the line broke. `port` is its name in messages.
    pub fn connect(connect: Connect, port: &str) -> Result<Self, ClientError> {
        Self::start(connect, port, false, None)
    }

    /// As [`Client::connect`] at this link rate, if both ends support it.
    pub fn connect_at(connect: Connect, port: &str, rate: LinkRate) -> Result<Self, ClientError> {
        Self::start(connect, port, false, Some(rate))
    }

    fn start(
        connect: Connect,
        port: &str,
        emulated: bool,
        wanted: Option<LinkRate>,
    ) -> Result<Self, ClientError> {
        Self::start_at(connect, port, emulated, (wanted, wanted), None)
    }

    /// `rates`: of the first hello, and requested.
    fn start_at(
        connect: Connect,
        port: &str,
        emulated: bool,
        rates: (Option<LinkRate>, Option<LinkRate>),
        interrupt: Option<Arc<AtomicBool>>,
    ) -> Result<Self, ClientError> {
        let (inbox, commands) = channel();
        let timing = Arc::new(Mutex::new(Timing::REAL));
        let choose = |hello: &Hello| {
            if hello.emulated {
                *timing.lock().unwrap_or_else(PoisonError::into_inner) = Timing::EMULATED;
            }
            Arc::clone(&timing)
        };
        let owner = Owner::start(connect, port, emulated, rates, choose, commands, interrupt.clone())?;
        let (session, held) = (owner.session(), owner.held());
        let thread = std::thread::spawn(move || owner.run());
        let port = Port {
            name: port.into(),
            timing,
            wanted: rates.1,
            known: Mutex::default(),
            held,
            inbox: Some(inbox),
            thread: Some(thread),
        };
        Ok(Self { port: Arc::new(port), session, interrupt, light: None, alternating: false })
    }

    /// Light during each exposure of this handle's programs; the board rejects it for shots that it does not trigger.
    pub fn set_light(&mut self, light: Option<LightLevels>) {
        self.light = light;
    }

    /// A handle whose programs have light in the first shot and every second one after it.
    pub(crate) fn with_alternating_light(&self) -> Self {
        Self { alternating: true, ..self.clone() }
    }

    pub(crate) fn light(&self, index: u8) -> Option<LightLevels> {
        self.light.filter(|_| !self.alternating || index.is_multiple_of(2))
    }

    /// Continues after a reset or unplugging. Axes are at rest and not homed. May be repeated.
    pub fn reopen(&mut self) -> Result<(), ClientError> {
        let (answer, joined) = sync_channel(1);
        self.command(Command::Join { known: self.session.number, answer }, "saying hello")?;
        self.session = joined.recv().map_err(|_| self.ended("saying hello"))??;
        *self.known() = Known::default();
        Ok(())
    }

    /// As [`Client::reopen`], repeated for at most `allowed`.
    pub fn reopen_within(&mut self, allowed: Duration) -> Result<(), ClientError> {
        let until = Instant::now() + allowed;
        loop {
            match self.reopen() {
                Ok(()) => return Ok(()),
                Err(error) if Instant::now() >= until || self.interrupted() => return Err(error),
                Err(_) => std::thread::sleep(NEXT_ATTEMPT),
            }
        }
    }

    /// Cleared if they may have changed.
    pub(crate) fn known(&self) -> MutexGuard<'_, Known> {
        self.port.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a handle has work that it has not dropped.
    pub(crate) fn has_work(&self) -> bool {
        let held = self.port.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.iter().any(|held| held.strong_count() > 0)
    }

    pub fn hello(&self) -> &Hello {
        &self.session.hello
    }

    pub fn protocol(&self) -> u8 {
        self.session.version
    }

    /// Note if the firmware's version differs from this program's; both use the same protocol.
    pub fn firmware_note(&self) -> Option<String> {
        let (theirs, ours) = (self.hello().firmware.as_str(), env!("CARGO_PKG_VERSION"));
        (theirs != ours).then(|| {
            format!(
                "the board's firmware is version {theirs}, this program {ours}; they speak the same protocol, but consider \
                 flashing the firmware that belongs to it"
            )
        })
    }

    pub fn link_rate(&self) -> LinkRate {
        self.session.rate
    }

    /// Note if the link rate differs from the requested one.
    pub fn link_note(&self) -> Option<String> {
        let (wanted, has) = (self.port.wanted?, self.link_rate());
        (wanted != has).then(|| {
            format!(
                "the link stays at {} baud: the board is not heard at {}; its adapter or its firmware cannot have that rate, or the rig was moving",
                has.baud(),
                wanted.baud()
            )
        })
    }

    /// Note if the board has reappeared under another port name.
    pub fn port_note(&self) -> Option<String> {
        let (named, has) = (self.port(), &*self.session.port);
        (named != has).then(|| format!("the board that was on {named} has come back on {has}"))
    }

    pub fn port(&self) -> &str {
        &self.port.name
    }

    pub fn timing(&self) -> Timing {
        *self.port.timing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the timeouts of all handles, for tests or unusual lines.
    pub fn set_timing(&self, timing: Timing) {
        *self.port.timing.lock().unwrap_or_else(PoisonError::into_inner) = timing;
    }

    /// Once this flag is set, waits for work stop the board and return [`ClientError::Interrupted`]. Clones share it.
    pub fn interrupt_by(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    pub fn interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Sends a request until it is answered; `during` describes it, e.g. "homing". Returns the id that events refer to.
    pub fn request(&self, request: &Request, during: &str) -> Result<(u32, Response), ClientError> {
        self.ask(request, during, None)
    }

    pub(crate) fn ask(
        &self,
        request: &Request,
        during: &str,
        listener: Option<Listener>,
    ) -> Result<(u32, Response), ClientError> {
        let question = Question { request: request.clone(), during: during.into(), listener };
        let answered = self.ask_together(vec![question], during)?;
        answered.into_iter().next().unwrap_or_else(|| Err(nothing(during)))
    }

    /// Sends several requests in one write, so that they arrive together even from a slow computer.
    pub(crate) fn ask_together(
        &self,
        questions: Vec<Question>,
        during: &str,
    ) -> Result<Vec<Answered>, ClientError> {
        let (answers, answered) = sync_channel(1);
        let stopping = self.interrupted(); // what follows an interruption is awaited, e.g. a stop
        self.command(Command::Ask { session: self.session.number, questions, answers }, during)?;
        let mut interrupted: Option<Instant> = None;
        loop {
            match answered.recv_timeout(INTERRUPT_POLL) {
                Ok(answered) => return Ok(answered),
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended(during)),
                Err(RecvTimeoutError::Timeout) if stopping || !self.interrupted() => {}
                Err(RecvTimeoutError::Timeout) => {
                    if interrupted.get_or_insert_with(Instant::now).elapsed() >= ANSWER_GRACE {
                        return Err(ClientError::Interrupted { during: during.into(), stopped: false });
                    }
                }
            }
        }
    }

    /// Sends a request without long work.
    pub(crate) fn expect_accepted(&self, request: &Request, during: &str) -> Result<(), ClientError> {
        match self.request(request, during)? {
            (_, Response::Accepted) => Ok(()),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    pub fn status(&self) -> Result<Status, ClientError> {
        let during = "reading the status";
        match self.request(&Request::Status, during)? {
            (_, Response::Status(status)) => Ok(status),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// The board's log from now on: its defmt stream, to be decoded with the firmware's ELF.
    pub fn logs(&self) -> Result<LogStream, ClientError> {
        let (sender, stream) = LogStream::new();
        self.command(Command::Logs(sender), "listening")?;
        Ok(stream)
    }

    fn command(&self, command: Command, during: &str) -> Result<(), ClientError> {
        let inbox = self.port.inbox.as_ref().ok_or_else(|| self.ended(during))?;
        inbox.send(command).map_err(|_| self.ended(during))
    }

    pub(crate) fn ended(&self, during: &str) -> ClientError {
        let source = Arc::new(std::io::Error::other("the port's owner has ended"));
        ClientError::Gone { port: self.port().into(), during: during.into(), source }
    }
}

fn serial(port: &str) -> Connect {
    let mut place = Place::new(port);
    Box::new(move || place.open())
}
