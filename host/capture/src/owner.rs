//! Thread that owns a port: sends requests, receives frames and distributes them. Handles ([`crate::Client`]) send
//! commands over a channel. The thread delivers events in order without gaps, answers keep-alives
//! ([`EventKind::StillThere`]) while the work is held, and says hello after a reset or unplugging. A new hello starts a
//! new *session*: older handles and work fail, because the rig may have lost its position.

mod session;

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError, Weak,
        atomic::AtomicBool,
        mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender},
    },
    time::{Duration, Instant},
};

use farnear_protocol::{
    Log, Request, RequestError, Response,
    frame::{Kind, Packet},
    message::{EventKind, Hello, LinkRate, Status},
};

use crate::{
    error::{ClientError, PortError},
    events::{Events, is_under_way, request_of},
    handshake::{open_session, shake_hands},
    link::Link,
    link_rate,
    log_stream::{LogPart, Readers},
    timing::Timing,
    transport::Transport,
};

pub(crate) use session::{Break, Session};

/// Opens the line, initially and after it broke.
pub type Connect = Box<dyn FnMut() -> Result<Box<dyn Transport>, PortError> + Send>;

/// Polling interval while events are awaited, hence their delay.
const ALERT: Duration = Duration::from_millis(1);
/// Polling interval while no event is awaited.
const IDLE: Duration = Duration::from_millis(50);
/// Unanswered polls in a row, each with all repeats, after which a real board is dead.
const UNANSWERED_POLLS: u32 = 2;
/// Longest read between two commands.
const GLANCE: Duration = Duration::from_millis(1);

pub(crate) enum Message {
    Event(EventKind, Instant),
    Broken(Break),
    EventsLost {
        from: u32,
        to: u32,
    },
    /// The board has ended the work without an event.
    NoEnd,
}

pub(crate) struct Listener {
    pub messages: Sender<Message>,
    /// Dropped with the work.
    pub held: Weak<()>,
    /// Lost events do not end it.
    pub bears_loss: bool,
}

pub(crate) struct Question {
    pub request: Request,
    pub during: String,
    pub listener: Option<Listener>,
}

pub(crate) type Answered = Result<(u32, Response), ClientError>;

pub(crate) enum Command {
    Ask {
        session: u32,
        questions: Vec<Question>,
        answers: SyncSender<Vec<Answered>>,
    },
    /// Returns the present session; says hello if `known` has ended.
    Join {
        known: u32,
        answer: SyncSender<Result<Session, ClientError>>,
    },
    Logs(SyncSender<LogPart>),
}

/// The work that handles may have, entered before its start is answered.
pub(crate) type Held = Arc<Mutex<Vec<Weak<()>>>>;

pub(crate) struct Owner {
    link: Link,
    connect: Connect,
    wanted: Option<LinkRate>,
    inbox: Receiver<Command>,
    timing: Arc<Mutex<Timing>>,
    session: Session,
    /// Set without a session.
    broken: Option<Break>,
    last_break: Option<Break>,
    next_attempt: Instant,
    events: Events,
    works: BTreeMap<u32, Listener>,
    held: Held,
    logs: Readers,
    next_log: Option<u32>,
    still_there: bool,
    last_heard: Instant,
    unanswered: u32,
}

impl Owner {
    pub(crate) fn start(
        mut connect: Connect,
        port: &str,
        emulated: bool,
        (first, wanted): (Option<LinkRate>, Option<LinkRate>),
        timing: impl FnOnce(&Hello) -> Arc<Mutex<Timing>>,
        inbox: Receiver<Command>,
        interrupt: Option<Arc<AtomicBool>>,
    ) -> Result<Self, ClientError> {
        let mut link = Link::new(connect()?, port);
        link.interrupt_by(interrupt);
        // An earlier host may have set this rate.
        link.set_rate(first.unwrap_or(LinkRate::START), "opening the port")?;
        let (hello, version) = shake_hands(&mut link, emulated)?;
        open_session(&mut link, (&hello, version))?;
        let timing = timing(&hello);
        if let Some(wanted) = wanted {
            let timing = *timing.lock().unwrap_or_else(PoisonError::into_inner);
            link_rate::change(&mut link, (version, hello.boot), wanted, timing)?;
        }
        let events = Events { boot: hello.boot, ..Events::default() };
        let session = Session {
            number: 1,
            hello: Arc::new(hello),
            version,
            rate: link.rate(),
            port: link.port().into(),
        };
        let now = Instant::now();
        let mut owner = Self {
            link,
            connect,
            wanted,
            inbox,
            timing,
            session,
            broken: None,
            last_break: None,
            next_attempt: now,
            events,
            works: BTreeMap::new(),
            held: Held::default(),
            logs: Readers::default(),
            next_log: None,
            still_there: false,
            last_heard: now,
            unanswered: 0,
        };
        owner.join_events()?;
        owner.link.opened();
        Ok(owner)
    }

    pub(crate) fn session(&self) -> Session {
        self.session.clone()
    }

    pub(crate) fn held(&self) -> Held {
        Arc::clone(&self.held)
    }

    pub(crate) fn run(mut self) {
        loop {
            let awaited = !self.works.is_empty() || !self.logs.is_empty();
            match self.inbox.recv_timeout(if awaited { ALERT } else { IDLE }) {
                Ok(command) => self.obey(command),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if self.broken.is_some() {
                self.try_again_when_due();
                continue;
            }
            self.glance();
            self.give_out();
            self.poll_when_quiet();
        }
    }

    fn timing(&self) -> Timing {
        *self.timing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Ask { session, questions, answers } => {
                let answered = self.ask_for(session, questions);
                let _ = answers.send(answered); // who asked may have gone
            }
            Command::Join { known, answer } => {
                let result = self.join(known);
                let _ = answer.send(result);
            }
            Command::Logs(sender) => self.logs.add(sender),
        }
    }

    fn ask_for(&mut self, session: u32, questions: Vec<Question>) -> Vec<Answered> {
        if let Some(broken) = self.break_of(session) {
            let port = self.link.port();
            return questions.iter().map(|question| Err(broken.error(port, &question.during))).collect();
        }
        let asked: Vec<_> =
            questions.iter().map(|question| (&question.request, question.during.as_str())).collect();
        let answered = match self.ask_all(&asked) {
            Ok(answered) => answered,
            Err(error) => {
                let starts = questions.iter().any(|question| question.listener.is_some());
                if starts && self.broken.is_none() && matches!(error, ClientError::Silent { .. }) {
                    // The board may have begun it.
                    let _ = self.ask(&Request::Stop, "stopping");
                }
                return vec![Err(error)];
            }
        };
        let mut abandoned = false;
        for (question, answered) in questions.into_iter().zip(&answered) {
            if let (Some(listener), Ok((id, Response::Accepted))) = (question.listener, answered) {
                abandoned |= listener.held.strong_count() == 0;
                let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
                held.retain(|held| held.strong_count() > 0);
                held.push(listener.held.clone());
                // Registered before events are delivered, so that even ended work gets its end.
                self.works.insert(*id, listener);
            }
        }
        self.give_out();
        if abandoned {
            // Interrupted before the board accepted the work.
            let _ = self.ask(&Request::Stop, "stopping");
        }
        answered
    }

    fn ask(&mut self, request: &Request, during: &str) -> Answered {
        let answered = self.ask_all(&[(request, during)])?;
        answered.into_iter().next().unwrap_or_else(|| Err(nothing(during)))
    }

    /// Sends requests together until all are answered.
    fn ask_all(&mut self, asked: &[(&Request, &str)]) -> Result<Vec<Answered>, ClientError> {
        let during = asked.iter().map(|(_, during)| *during).collect::<Vec<_>>().join(" and ");
        let requests: Vec<_> = asked.iter().map(|(request, _)| *request).collect();
        let timing = self.timing();
        let waits = vec![timing.reply; timing.retries as usize + 1];
        let address = (self.session.version, self.session.hello.boot);
        let (events, mut logs) = (&mut self.events, Vec::new());
        let on_other = &mut |packet: &Packet| match packet.header.kind {
            Kind::Event => events.take(packet, &during),
            _ => {
                logs.push(packet.clone());
                Ok(())
            }
        };
        let answers = self.link.ask_all(address, &requests, &waits, &during, on_other);
        logs.iter().for_each(|packet| self.take_log(packet));
        let answers = answers.inspect_err(|error| self.break_off(error))?;
        self.last_heard = Instant::now();
        let answers = answers.into_iter().zip(asked);
        Ok(answers.map(|((id, packet), (_, during))| Ok((id, self.read(&packet, during)?))).collect())
    }

    fn read(&mut self, packet: &Packet, during: &str) -> Result<Response, ClientError> {
        let unreadable = || ClientError::Nonsense {
            during: during.into(),
            answer: format!("{:?} {:02x?}", packet.header.kind, packet.body.as_slice()),
        };
        if packet.header.kind == Kind::Response {
            return packet.message().ok_or_else(unreadable);
        }
        Err(match packet.message().ok_or_else(unreadable)? {
            RequestError::Boot { current } => {
                let was = self.session.hello.boot;
                let error = ClientError::Reset { during: during.into(), was, now: current, cause: None };
                self.break_off(&error);
                error
            }
            RequestError::NotInSession => {
                let error = ClientError::TakenOver { port: self.link.port().into(), during: during.into() };
                self.break_off(&error);
                error
            }
            error => ClientError::Refused { during: during.into(), error },
        })
    }

    fn status(&mut self, during: &str) -> Result<Status, ClientError> {
        match self.ask(&Request::Status, during)? {
            (_, Response::Status(status)) => Ok(status),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    fn glance(&mut self) {
        loop {
            match self.link.receive(Instant::now() + GLANCE, "listening") {
                Ok(Some(packet)) => {
                    let taken = match packet.header.kind {
                        Kind::Event => {
                            self.last_heard = Instant::now();
                            self.events.take(&packet, "listening")
                        }
                        Kind::Log => {
                            self.take_log(&packet);
                            Ok(())
                        }
                        Kind::Request | Kind::Response | Kind::Error => Ok(()),
                    };
                    if let Err(error) = taken {
                        return self.break_off(&error);
                    }
                }
                Ok(None) => return,
                Err(error) => return self.break_off(&error),
            }
        }
    }

    fn take_log(&mut self, packet: &Packet) {
        let Some(log) = packet.message::<Log>() else { return };
        let number = packet.header.id;
        let missing = self.next_log.map_or(0, |next| number.wrapping_sub(next));
        self.next_log = Some(number.wrapping_add(1));
        self.logs.tell(&LogPart { number, missing, bytes: log.bytes.to_vec() });
    }

    /// Delivers due events, fetches lost ones, and answers keep-alives.
    fn give_out(&mut self) {
        while self.broken.is_none() {
            if let Some(event) = self.events.pop() {
                self.deliver(&event.kind);
            } else if !self.events.arrived.is_empty() {
                if !self.fetch_due_event() {
                    return; // read again later; a line that stays silent ends the session
                }
            } else if std::mem::take(&mut self.still_there) {
                // Any valid frame suffices; errors end the session or appear at the next poll.
                let _ = self.status("answering whether this program is still there");
            } else {
                return;
            }
        }
    }

    fn deliver(&mut self, kind: &EventKind) {
        match request_of(kind) {
            Some((request, ends)) => {
                if let Some(work) = self.works.get(&request) {
                    let held = work.held.strong_count() > 0;
                    if matches!(kind, EventKind::StillThere { .. }) {
                        self.still_there |= held;
                    } else {
                        let _ = work.messages.send(Message::Event(kind.clone(), Instant::now()));
                    }
                    if ends || !held {
                        self.works.remove(&request);
                    }
                }
            }
            None if matches!(kind, EventKind::Alarm(_)) => {
                for work in self.works.values() {
                    let _ = work.messages.send(Message::Event(kind.clone(), Instant::now()));
                }
            }
            None => {}
        }
    }

    /// Returns whether the board has answered.
    fn fetch_due_event(&mut self) -> bool {
        let number = self.events.due;
        let forgotten = match self.ask(&Request::ReadEvent { number }, "reading an event that got lost") {
            Ok((_, Response::Event(event))) => {
                self.events.arrived.insert(number, event);
                return true;
            }
            Err(ClientError::Silent { .. }) => return false,
            Err(ClientError::Refused { error: RequestError::EventGone { oldest, next }, .. }) => {
                oldest.min(next).max(number + 1)
            }
            // An answer that cannot be read, or the session has ended.
            Ok(_) | Err(_) => number + 1,
        };
        // Events that arrived are not lost, even if the board has forgotten them.
        let arrived = self.events.arrived.keys().next().copied();
        self.events.due = arrived.map_or(forgotten, |first| first.clamp(number + 1, forgotten));
        let to = self.events.due - 1;
        self.works.retain(|_, work| {
            if !work.bears_loss {
                let _ = work.messages.send(Message::EventsLost { from: number, to });
            }
            work.bears_loss
        });
        true
    }

    /// Polls during work after a silence: fetches lost events, and detects work that ended without one.
    fn poll_when_quiet(&mut self) {
        self.works.retain(|_, work| work.held.strong_count() > 0);
        if self.works.is_empty() || self.last_heard.elapsed() < self.timing().poll {
            return;
        }
        self.last_heard = Instant::now();
        let begin = Instant::now();
        let status = match self.status("asking for events that got lost") {
            Ok(status) => status,
            Err(ClientError::Silent { attempts, .. }) => {
                self.unanswered += 1;
                // The repeats to an emulated board take longer than a disturbance of its line: it has stopped.
                if self.unanswered >= UNANSWERED_POLLS || self.session.hello.emulated {
                    let attempts = attempts * self.unanswered;
                    let waited = begin.elapsed() + self.timing().poll * (self.unanswered - 1);
                    self.end_session(Break::Silent { attempts, waited });
                }
                return;
            }
            Err(_) => return,
        };
        self.unanswered = 0;
        if !self.events.arrived.is_empty() {
            return;
        }
        if status.next_event > self.events.due {
            self.fetch_due_event();
            return;
        }
        self.works.retain(|id, work| {
            let goes_on = is_under_way(*id, &status);
            if !goes_on {
                let _ = work.messages.send(Message::NoEnd);
            }
            goes_on
        });
    }
}

pub(crate) fn nothing(during: &str) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: "no answer".into() }
}

pub(crate) fn nonsense(during: &str, response: &Response) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: format!("{response:?}") }
}
