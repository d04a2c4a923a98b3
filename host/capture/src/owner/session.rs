use std::{
    io,
    sync::Arc,
    time::{Duration, Instant},
};

use farnear_protocol::message::{Hello, LinkRate, ResetCause};

use super::{Message, Owner};
use crate::{
    error::ClientError,
    events::Events,
    handshake::{open_session, shake_hands},
    link_rate,
};

const RECONNECT: Duration = Duration::from_millis(500);

#[derive(Clone)]
pub(crate) struct Session {
    /// Session count of this owner.
    pub number: u32,
    pub hello: Arc<Hello>,
    pub version: u8,
    pub rate: LinkRate,
    pub port: Arc<str>,
}

#[derive(Clone, Debug)]
pub(crate) enum Break {
    Gone(Arc<io::Error>),
    TakenOver,
    OtherBoard {
        was: [u8; 12],
        now: [u8; 12],
    },
    /// Port open, but no answer: attempts and duration.
    Silent {
        attempts: u32,
        waited: Duration,
    },
    Reset {
        was: u32,
        now: u32,
        cause: Option<ResetCause>,
    },
}

impl Break {
    fn has_no_line(&self) -> bool {
        matches!(self, Self::Gone(_) | Self::OtherBoard { .. })
    }

    pub(crate) fn error(&self, port: &str, during: &str) -> ClientError {
        let during = during.into();
        match self.clone() {
            Self::Gone(source) => ClientError::Gone { port: port.into(), during, source },
            Self::Silent { attempts, waited } => {
                ClientError::Silent { port: port.into(), during, attempts, waited, bad_frames: 0, bytes: 0 }
            }
            Self::TakenOver => ClientError::TakenOver { port: port.into(), during },
            Self::OtherBoard { was, now } => ClientError::OtherBoard { port: port.into(), was, now },
            Self::Reset { was, now, cause } => ClientError::Reset { during, was, now, cause },
        }
    }
}

impl Owner {
    /// Error for a handle of this session.
    pub(super) fn break_of(&self, session: u32) -> Option<Break> {
        if self.broken.is_some() {
            return self.broken.clone();
        }
        // The board is back, but this handle has not been informed.
        self.last_break.clone().filter(|_| session != self.session.number)
    }

    pub(super) fn break_off(&mut self, error: &ClientError) {
        let broken = match error {
            ClientError::Gone { source, .. } => Break::Gone(Arc::clone(source)),
            ClientError::Reset { was, now, cause, .. } => {
                Break::Reset { was: *was, now: *now, cause: *cause }
            }
            ClientError::TakenOver { .. } => Break::TakenOver,
            ClientError::OtherBoard { was, now, .. } => Break::OtherBoard { was: *was, now: *now },
            // Each further request would wait as long. A real board is asked again, because answers get lost.
            ClientError::Silent { attempts, waited, .. }
                if self.link.interrupted() && self.session.hello.emulated =>
            {
                Break::Silent { attempts: *attempts, waited: *waited }
            }
            _ => return,
        };
        self.end_session(broken);
    }

    pub(super) fn end_session(&mut self, broken: Break) {
        for (_, work) in std::mem::take(&mut self.works) {
            let _ = work.messages.send(Message::Broken(broken.clone()));
        }
        if broken.has_no_line() {
            self.link.close();
        }
        self.events.arrived.clear();
        self.still_there = false;
        self.unanswered = 0;
        // A reset board is present; an unplugged one takes a while.
        let is_there = matches!(broken, Break::Reset { .. } | Break::TakenOver);
        let pause = if is_there { Duration::ZERO } else { RECONNECT };
        self.next_attempt = Instant::now() + pause;
        self.last_break = Some(broken.clone());
        self.broken = Some(broken);
    }

    pub(super) fn try_again_when_due(&mut self) {
        // The port name of an ended simulator may be reused, unless it is a link.
        let gone = matches!(self.broken, Some(Break::Gone(_)));
        let named = std::fs::symlink_metadata(self.link.port()).is_ok_and(|found| found.is_symlink());
        let nobodys = gone && self.session.hello.emulated && !named;
        // A board taken over by another host is left alone until requested.
        let taken = matches!(self.broken, Some(Break::TakenOver));
        // Likewise another board.
        let others = matches!(self.broken, Some(Break::OtherBoard { .. }));
        // An interrupted program ends.
        let ends = self.link.interrupted();
        if !nobodys && !taken && !others && !ends && Instant::now() >= self.next_attempt {
            // Retried while handles exist.
            let _ = self.reconnect();
        }
    }

    pub(super) fn join(&mut self, known: u32) -> Result<Session, ClientError> {
        if self.broken.is_some() {
            self.reconnect()?;
        } else if known == self.session.number {
            self.say_hello()?;
        }
        Ok(self.session.clone())
    }

    pub(super) fn reconnect(&mut self) -> Result<(), ClientError> {
        if self.broken.as_ref().is_some_and(Break::has_no_line) {
            self.link.close(); // of an attempt that was not answered
            let opened = (self.connect)();
            self.next_attempt = Instant::now() + RECONNECT;
            self.link.replace(opened?);
        }
        let result = self.say_hello();
        self.next_attempt = Instant::now() + RECONNECT;
        result
    }

    pub(super) fn say_hello(&mut self) -> Result<(), ClientError> {
        let before = self.session.hello.boot;
        let shaken = shake_hands(&mut self.link, self.session.hello.emulated);
        let (hello, version) = shaken.inspect_err(|error| self.break_off(error))?;
        let (was, now) = (self.session.hello.unique_id, hello.unique_id);
        if was != now {
            let error = ClientError::OtherBoard { port: self.link.port().into(), was, now };
            self.break_off(&error);
            return Err(error);
        }
        let was_broken = self.broken.is_some();
        self.session.version = version;
        if hello.boot == before && !was_broken {
            self.session.hello = Arc::new(hello);
            return Ok(()); // same session: work continues, and drained events are fetched
        }
        if !was_broken {
            let (was, now, cause) = (before, hello.boot, Some(hello.reset_cause));
            self.break_off(&ClientError::Reset { during: "saying hello".into(), was, now, cause });
        }
        let opened = open_session(&mut self.link, (&hello, version));
        opened.inspect_err(|error| self.break_off(error))?;
        if let Some(wanted) = self.wanted {
            let timing = self.timing();
            let changed = link_rate::change(&mut self.link, (version, hello.boot), wanted, timing);
            changed.inspect_err(|error| self.break_off(error))?;
        }
        self.session.rate = self.link.rate();
        self.session.port = self.link.port().into();
        self.session.number += 1;
        self.events = Events { boot: hello.boot, ..Events::default() };
        self.next_log = None;
        self.session.hello = Arc::new(hello);
        self.join_events()?;
        self.broken = None;
        Ok(())
    }

    pub(super) fn join_events(&mut self) -> Result<(), ClientError> {
        let due = self.status("reading the status")?.next_event;
        self.events.due = due;
        self.events.arrived.retain(|number, _| *number >= due);
        Ok(())
    }
}
