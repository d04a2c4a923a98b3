//! A handle of a board: requests that are answered or fail, and streams of what the board says by itself.
//!
//! A request is sent with an id and the board's boot number and sent again, byte for byte, until its answer
//! comes; the board acts once per id. Handles can be cloned and used from any thread; one thread owns the port and sends
//! one request after the other. A handle belongs to one session: after a reset or an unplugging every
//! request gives [`ClientError::Reset`] or [`ClientError::Gone`] until [`Client::reopen`] says that this is understood,
//! for the rig may have lost its position. See `docs/protocol.md`.

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
    owner::{Answered, Command, Connect, Listener, Owner, Question, Session, nonsense, nothing},
    timing::{Pace, Timing},
    transport::{Place, Transport, with_rate},
};

/// Interval at which the wait for an answer checks for an interruption.
const INTERRUPT_POLL: Duration = Duration::from_millis(25);
/// How long an answer is still awaited after an interruption.
const ANSWER_GRACE: Duration = Duration::from_millis(150);
/// From one attempt to reach a board that restarts to the next.
const NEXT_ATTEMPT: Duration = Duration::from_millis(50);

/// A handle of a board.
#[derive(Clone)]
pub struct Client {
    port: Arc<Port>,
    session: Session,
    interrupt: Option<Arc<AtomicBool>>,
    /// Light of the shots that the board triggers.
    light: Option<LightLevels>,
}

/// The way to the thread that owns the port; the thread ends with the last handle.
struct Port {
    name: String,
    timing: Arc<Mutex<Timing>>,
    /// The rate that the link was to have.
    wanted: Option<LinkRate>,
    /// How fast the axes move, as far as the board was asked.
    paces: Mutex<Vec<(Axis, Pace)>>,
    inbox: Option<Sender<Command>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Port {
    fn drop(&mut self) {
        drop(self.inbox.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // it never panics; what it still had to send is sent now
        }
    }
}

impl Client {
    /// Opens a serial port and says hello. Once the board was there, the port is opened again whenever it comes back. A rate
    /// behind its name, `/dev/ttyACM0@921600`, is asked of the board; where it is not heard at it, the link goes on at the rate
    /// it had, see [`Client::link_note`].
    pub fn open(port: &str) -> Result<Self, ClientError> {
        let (port, wanted) = with_rate(port)?;
        Self::start(serial(port), port, false, wanted)
    }

    /// As [`Client::open`], where the board is known to be emulated: hello is asked as patiently as all else, so
    /// that a slow computer does not ask it twice, which would make the run another one.
    pub fn open_emulated(port: &str) -> Result<Self, ClientError> {
        Self::start(serial(port), port, true, None)
    }

    /// Says hello over what `connect` opens, the first time and whenever the line broke. `port` is its name in messages.
    ///
    /// # Errors
    /// [`ClientError`] where nothing can be opened, nobody answers, or no protocol version is shared.
    pub fn connect(connect: Connect, port: &str) -> Result<Self, ClientError> {
        Self::start(connect, port, false, None)
    }

    /// As [`Client::connect`], at this rate of the link, where both ends can have it.
    pub fn connect_at(connect: Connect, port: &str, rate: LinkRate) -> Result<Self, ClientError> {
        Self::start(connect, port, false, Some(rate))
    }

    fn start(
        connect: Connect,
        port: &str,
        emulated: bool,
        wanted: Option<LinkRate>,
    ) -> Result<Self, ClientError> {
        let (inbox, commands) = channel();
        let timing = Arc::new(Mutex::new(Timing::REAL));
        let choose = |hello: &Hello| {
            if hello.emulated {
                *timing.lock().unwrap_or_else(PoisonError::into_inner) = Timing::EMULATED;
            }
            Arc::clone(&timing)
        };
        let owner = Owner::start(connect, port, emulated, wanted, choose, commands)?;
        let session = owner.session();
        let thread = std::thread::spawn(move || owner.run());
        let port = Port {
            name: port.into(),
            timing,
            wanted,
            paces: Mutex::default(),
            inbox: Some(inbox),
            thread: Some(thread),
        };
        Ok(Self { port: Arc::new(port), session, interrupt: None, light: None })
    }

    /// Gives every shot of the programs that this handle arms this light, from the start of its exposure to the end; `None` for no
    /// light. The board refuses it for shots that it does not trigger.
    pub fn set_light(&mut self, light: Option<LightLevels>) {
        self.light = light;
    }

    pub(crate) fn light(&self) -> Option<LightLevels> {
        self.light
    }

    /// Goes on with a board after it was reset or unplugged: says hello if that has not happened yet. What was moving is
    /// at rest and not homed, whatever it was before.
    ///
    /// # Errors
    /// [`ClientError`] where the board is not there (yet): it may be tried again.
    pub fn reopen(&mut self) -> Result<(), ClientError> {
        let (answer, joined) = sync_channel(1);
        self.command(Command::Join { known: self.session.number, answer }, "saying hello")?;
        self.session = joined.recv().map_err(|_| self.ended("saying hello"))??;
        self.paces().clear();
        Ok(())
    }

    /// As [`Client::reopen`], tried again for at most `allowed`.
    ///
    /// # Errors
    /// The last error, when time is up.
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

    /// How fast the axes move, as far as the board was asked; cleared where that may have changed.
    pub(crate) fn paces(&self) -> MutexGuard<'_, Vec<(Axis, Pace)>> {
        self.port.paces.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn hello(&self) -> &Hello {
        &self.session.hello
    }

    /// The protocol version of this session.
    pub fn protocol(&self) -> u8 {
        self.session.version
    }

    /// What is to be said about the firmware's version, where it is another than this program's. Both speak the same
    /// protocol all the same.
    pub fn firmware_note(&self) -> Option<String> {
        let (theirs, ours) = (self.hello().firmware.as_str(), env!("CARGO_PKG_VERSION"));
        (theirs != ours).then(|| {
            format!(
                "the board's firmware is version {theirs}, this program {ours}; they speak the same protocol, but consider \
                 flashing the firmware that belongs to it"
            )
        })
    }

    /// The link's rate in this session.
    pub fn link_rate(&self) -> LinkRate {
        self.session.rate
    }

    /// What is to be said about the link's rate, where it is another than was asked for.
    pub fn link_note(&self) -> Option<String> {
        let (wanted, has) = (self.port.wanted?, self.link_rate());
        (wanted != has).then(|| {
            format!(
                "the link stays at {} baud: the board is not heard at {}; its adapter or its firmware cannot have that rate",
                has.baud(),
                wanted.baud()
            )
        })
    }

    /// What is to be said about the port, where the board has come back under another name than it was opened by.
    pub fn port_note(&self) -> Option<String> {
        let (named, has) = (self.port(), &*self.session.port);
        (named != has).then(|| format!("the board that was on {named} has come back on {has}"))
    }

    /// Name of the port, as it was opened first.
    pub fn port(&self) -> &str {
        &self.port.name
    }

    /// The waiting times in use.
    pub fn timing(&self) -> Timing {
        *self.port.timing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Uses other waiting times, for a test or an unusual line; for all handles.
    pub fn set_timing(&self, timing: Timing) {
        *self.port.timing.lock().unwrap_or_else(PoisonError::into_inner) = timing;
    }

    /// Once this flag becomes true, waiting for work ends: the board is told to stop and
    /// [`ClientError::Interrupted`] is returned. Handles cloned from now on share it.
    pub fn interrupt_by(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    /// Whether the user interrupted.
    pub fn interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Sends a request until its answer comes. `during` says what for, e.g. "homing". Gives the request's id,
    /// which events will name.
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

    /// Asks for several things by one write, so that they come at the same time however slow this computer is.
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
                    // Work that is accepted later has no listener and is stopped by the port's owner.
                    if interrupted.get_or_insert_with(Instant::now).elapsed() >= ANSWER_GRACE {
                        return Err(ClientError::Interrupted { during: during.into() });
                    }
                }
            }
        }
    }

    /// Asks for something that is done at once.
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

    /// The board's log from now on: pieces of its defmt stream, to be decoded with the firmware's ELF file.
    ///
    /// # Errors
    /// [`ClientError::Gone`] where the port's owner has ended.
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
    Box::new(move || Ok(Box::new(place.open()?) as Box<dyn Transport>))
}
