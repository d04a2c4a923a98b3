//! The one owner of a port: a thread that sends requests, receives frames and hands them to whom they concern.
//!
//! Handles ([`crate::Client`]) give it commands over a channel. It keeps the events in order and without gaps, answers
//! the board's [`EventKind::StillThere`] as long as somebody holds the work that is asked about, and says hello anew
//! after a reset or an unplugging. A new hello begins a new *session*: what belongs to the old one, a handle or running
//! work, gets an error and has to decide for itself, because the rig may have lost its position.

mod session;

use std::{
    collections::BTreeMap,
    sync::{
        Arc, Mutex, PoisonError, Weak,
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

/// Opens the line to the board, the first time and after it broke.
pub type Connect = Box<dyn FnMut() -> Result<Box<dyn Transport>, PortError> + Send>;

/// Longest wait for a command while events are awaited, and so the delay of an event.
const ALERT: Duration = Duration::from_millis(1);
/// Longest wait for a command while nobody awaits an event.
const IDLE: Duration = Duration::from_millis(50);
/// A board that does not answer so many polls in a row, each asked as often as any request, is dead.
const UNANSWERED_POLLS: u32 = 2;
/// Longest look for bytes between two commands.
const GLANCE: Duration = Duration::from_millis(1);

/// What running work is told.
pub(crate) enum Message {
    Event(EventKind, Instant),
    Broken(Break),
    EventsLost {
        from: u32,
        to: u32,
    },
    /// The board says that it is not working on it, and no event tells how it ended.
    NoEnd,
}

/// Where messages about work go.
pub(crate) struct Listener {
    pub messages: Sender<Message>,
    /// Gone when nobody holds the work any more.
    pub held: Weak<()>,
    /// Events that are lost for ever are no reason to give it up.
    pub bears_loss: bool,
}

/// A request and what it is for.
pub(crate) struct Question {
    pub request: Request,
    pub during: String,
    /// Where it is long work.
    pub listener: Option<Listener>,
}

/// The number of a request, and its answer or refusal.
pub(crate) type Answered = Result<(u32, Response), ClientError>;

/// What handles ask of the owner.
pub(crate) enum Command {
    Ask {
        session: u32,
        questions: Vec<Question>,
        answers: SyncSender<Vec<Answered>>,
    },
    /// Gives the present session; says hello anew where it is still the known one, or none.
    Join {
        known: u32,
        answer: SyncSender<Result<Session, ClientError>>,
    },
    Logs(SyncSender<LogPart>),
}

pub(crate) struct Owner {
    link: Link,
    connect: Connect,
    /// The rate that the link is to have, where somebody asked for one.
    wanted: Option<LinkRate>,
    inbox: Receiver<Command>,
    timing: Arc<Mutex<Timing>>,
    session: Session,
    /// Set while there is no session.
    broken: Option<Break>,
    /// What ended the session before this one.
    last_break: Option<Break>,
    next_attempt: Instant,
    events: Events,
    works: BTreeMap<u32, Listener>,
    logs: Readers,
    next_log: Option<u32>,
    still_there: bool,
    last_heard: Instant,
    /// Polls in a row that nobody answered.
    unanswered: u32,
}

impl Owner {
    /// Opens the line and says hello.
    pub(crate) fn start(
        mut connect: Connect,
        port: &str,
        emulated: bool,
        wanted: Option<LinkRate>,
        timing: impl FnOnce(&Hello) -> Arc<Mutex<Timing>>,
        inbox: Receiver<Command>,
    ) -> Result<Self, ClientError> {
        let mut link = Link::new(connect()?, port);
        // A host before this one may have asked for the same.
        link.set_rate(wanted.unwrap_or(LinkRate::START), "opening the port")?;
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
            logs: Readers::default(),
            next_log: None,
            still_there: false,
            last_heard: now,
            unanswered: 0,
        };
        owner.join_events()?;
        Ok(owner)
    }

    pub(crate) fn session(&self) -> Session {
        self.session.clone()
    }

    /// Works until the last handle has gone.
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

    /// The answer to each question; one error where nobody answers.
    fn ask_for(&mut self, session: u32, questions: Vec<Question>) -> Vec<Answered> {
        if let Some(broken) = self.break_of(session) {
            let port = self.link.port();
            return questions.iter().map(|question| Err(broken.error(port, &question.during))).collect();
        }
        let asked: Vec<_> =
            questions.iter().map(|question| (&question.request, question.during.as_str())).collect();
        let answered = match self.ask_all(&asked) {
            Ok(answered) => answered,
            Err(error) => return vec![Err(error)],
        };
        let mut abandoned = false;
        for (question, answered) in questions.into_iter().zip(&answered) {
            if let (Some(listener), Ok((id, Response::Accepted))) = (question.listener, answered) {
                abandoned |= listener.held.strong_count() == 0;
                // Before any event is given out, so that even work that has ended already is told its end.
                self.works.insert(*id, listener);
            }
        }
        self.give_out();
        if abandoned {
            // The user interrupted before the board had accepted the work.
            let _ = self.ask(&Request::Stop, "stopping");
        }
        answered
    }

    /// Sends a request until its answer comes.
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

    /// What a frame answers.
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

    /// Takes what has arrived by itself.
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

    /// Gives the events out that are due, fetches those that got lost, and answers the board's question.
    fn give_out(&mut self) {
        while self.broken.is_none() {
            if let Some(event) = self.events.pop() {
                self.deliver(&event.kind);
            } else if !self.events.arrived.is_empty() {
                self.fetch_due_event();
            } else if std::mem::take(&mut self.still_there) {
                // Any good frame would do; what goes wrong ends the session, or is seen by the next poll.
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

    /// Asks the board for the due event, which did not arrive by itself.
    fn fetch_due_event(&mut self) {
        let number = self.events.due;
        match self.ask(&Request::ReadEvent { number }, "reading an event that got lost") {
            Ok((_, Response::Event(event))) => {
                self.events.arrived.insert(number, event);
            }
            Err(ClientError::Refused { error: RequestError::EventGone { oldest, next }, .. }) => {
                // What has arrived by itself is not lost, whatever the board remembers.
                let arrived = self.events.arrived.keys().next().copied();
                let forgotten = oldest.min(next).max(number + 1);
                self.events.due = arrived.map_or(forgotten, |first| first.clamp(number + 1, forgotten));
                let to = self.events.due - 1;
                self.works.retain(|_, work| {
                    if !work.bears_loss {
                        let _ = work.messages.send(Message::EventsLost { from: number, to });
                    }
                    work.bears_loss
                });
            }
            // Nobody answers: pass over the event, so that the rest is given out. The session's end is known already.
            Ok(_) | Err(_) => self.events.due += 1,
        }
    }

    /// While work is under way and nothing was heard for long: an event that got lost is fetched, and where the board
    /// is not working any more and no event is left, its end is unknown.
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
                if self.unanswered >= UNANSWERED_POLLS {
                    let attempts = attempts * UNANSWERED_POLLS;
                    self.end_session(Break::Silent { attempts, waited: begin.elapsed() });
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
            return self.fetch_due_event();
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

/// Nothing where an answer must be.
pub(crate) fn nothing(during: &str) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: "no answer".into() }
}

/// An answer that is none to what was asked.
pub(crate) fn nonsense(during: &str, response: &Response) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: format!("{response:?}") }
}
