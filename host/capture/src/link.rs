//! Frames over a [`Transport`], with repeats; keeps session and ids ([`Link::begin_session`]), not boot or version.

use std::{
    io::{self, ErrorKind},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use farnear_protocol::{
    Call, Request, RequestError,
    frame::{Decoder, Delimited, Header, Kind, Packet, delimited, encode},
    message::{LinkRate, NO_SESSION},
};

use crate::{error::ClientError, owner::nothing, transport::Transport};

/// Beyond the ids of any session, so that a late answer to an ended program is not taken for hello's.
const HELLO_ID: u32 = 1 << 31;
/// Silence after which no older answer is in transit.
const QUIET: Duration = Duration::from_millis(5);
/// Longest wait for silence.
const QUIET_AT_MOST: Duration = Duration::from_millis(500);
const SEND_AT_LEAST: Duration = Duration::from_millis(20);
/// Longest read between two looks at the interruption.
const SLICE: Duration = Duration::from_millis(25);
/// Longest wait for answers after an interruption. An emulated board, whose timeouts are longer, may be frozen.
const INTERRUPTED: Duration = Duration::from_secs(2);

/// Drops input until the line is silent, or the timeout.
fn until_quiet(transport: &mut dyn Transport, buffer: &mut [u8]) -> io::Result<()> {
    transport.discard_input()?;
    let until = Instant::now() + QUIET_AT_MOST;
    while Instant::now() < until && transport.receive(buffer, QUIET)? > 0 {}
    Ok(())
}

fn is_queue_full(packet: &Packet) -> bool {
    matches!(packet.message(), Some(RequestError::QueueFull { .. }))
}

struct Asked {
    id: u32,
    /// Identical for each repeat.
    bytes: Delimited,
    answer: Option<Packet>,
}

pub(crate) struct Link {
    /// `None` while unplugged.
    transport: Option<Box<dyn Transport>>,
    port: String,
    rate: LinkRate,
    decoder: Decoder,
    buffer: [u8; 512],
    unread: std::ops::Range<usize>,
    session: u32,
    next_id: u32,
    bytes: u64,
    bad_frames: u64,
    interrupt: Option<Arc<AtomicBool>>,
    /// When it was first seen.
    interrupted_at: Option<Instant>,
    /// An interruption shortens waits and does not end them.
    open: bool,
    /// When the present or last request was sent first.
    asked: Instant,
}

impl Link {
    pub(crate) fn new(transport: Box<dyn Transport>, port: &str) -> Self {
        Self {
            transport: Some(transport),
            port: port.into(),
            rate: LinkRate::START,
            decoder: Decoder::new(),
            buffer: [0; 512],
            unread: 0..0,
            session: NO_SESSION,
            next_id: 1,
            bytes: 0,
            bad_frames: 0,
            interrupt: None,
            interrupted_at: None,
            open: false,
            asked: Instant::now(),
        }
    }

    /// Once this flag is set, reads return [`ClientError::Interrupted`]; after [`Link::opened`] answers are awaited for
    /// at most [`INTERRUPTED`].
    pub(crate) fn interrupt_by(&mut self, flag: Option<Arc<AtomicBool>>) {
        self.interrupt = flag;
        self.interrupted_at = None;
    }

    /// From now on an interruption stops the rig over this link.
    pub(crate) fn opened(&mut self) {
        self.open = true;
    }

    pub(crate) fn interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// End of the waits after an interruption.
    fn last_wait(&mut self) -> Option<Instant> {
        let at = if self.interrupted() { Instant::now() } else { return None };
        Some(self.asked.max(*self.interrupted_at.get_or_insert(at)) + INTERRUPTED)
    }

    /// Starts a session; ids follow the last one seen by the board.
    pub(crate) fn begin_session(&mut self, number: u32, last_id: u32) {
        self.session = number;
        self.next_id = last_id.wrapping_add(1);
    }

    /// Continues over a new transport, at the rate of a board after reset.
    pub(crate) fn replace(&mut self, transport: Box<dyn Transport>) {
        if let Some(port) = transport.port() {
            self.port = port.into();
        }
        self.transport = Some(transport);
        self.rate = LinkRate::START;
        self.decoder = Decoder::new();
        self.unread = 0..0;
    }

    pub(crate) const fn rate(&self) -> LinkRate {
        self.rate
    }

    pub(crate) fn set_rate(&mut self, rate: LinkRate, during: &str) -> Result<(), ClientError> {
        if rate == self.rate {
            return Ok(());
        }
        let set = match &mut self.transport {
            Some(transport) => transport.set_rate(rate),
            None => Err(ErrorKind::NotConnected.into()),
        };
        set.map_err(|source| self.gone(source, during))?;
        self.rate = rate;
        self.decoder = Decoder::new();
        self.unread = 0..0;
        Ok(())
    }

    fn renew(&mut self, during: &str) -> Result<(), ClientError> {
        let renewed = match &mut self.transport {
            Some(transport) => transport.renew(self.rate),
            None => Err(ErrorKind::NotConnected.into()),
        };
        renewed.map_err(|source| self.gone(source, during))?;
        self.decoder = Decoder::new();
        self.unread = 0..0;
        Ok(())
    }

    /// Closes the port: while a program holds a port that has gone, a returning board gets another name.
    pub(crate) fn close(&mut self) {
        self.transport = None;
    }

    pub(crate) fn port(&self) -> &str {
        &self.port
    }

    pub(crate) fn ask(
        &mut self,
        address: (u8, u32),
        request: &Request,
        waits: &[Duration],
        during: &str,
        on_other: &mut dyn FnMut(&Packet) -> Result<(), ClientError>,
    ) -> Result<(u32, Packet), ClientError> {
        let answers = self.ask_all(address, &[request], waits, during, on_other)?;
        answers.into_iter().next().ok_or_else(|| nothing(during))
    }

    fn number(
        &mut self,
        (version, boot): (u8, u32),
        request: &Request,
        during: &str,
    ) -> Result<Asked, ClientError> {
        let (id, session) = if *request == Request::Hello {
            (HELLO_ID, NO_SESSION) // one id at all rates, so that a late answer counts
        } else {
            let id = self.next_id;
            self.next_id = id.wrapping_add(1).max(1);
            (id, self.session)
        };
        let header = Header { version, kind: Kind::Request, id, boot };
        let frame = encode(header, &Call { session, request: request.clone() }).ok_or_else(|| {
            ClientError::Nonsense { during: during.into(), answer: "the request does not fit a frame".into() }
        })?;
        Ok(Asked { id, bytes: delimited(&frame), answer: None })
    }

    /// Sends requests, limited to the board's outstanding ones, each at most `waits.len()` times. Returns id and answer
    /// per request; events and log frames go to `on_other`.
    pub(crate) fn ask_all(
        &mut self,
        address: (u8, u32),
        requests: &[&Request],
        waits: &[Duration],
        during: &str,
        on_other: &mut dyn FnMut(&Packet) -> Result<(), ClientError>,
    ) -> Result<Vec<(u32, Packet)>, ClientError> {
        let mut asked = requests
            .iter()
            .map(|request| self.number(address, request, during))
            .collect::<Result<Vec<_>, _>>()?;
        if asked.is_empty() {
            return Ok(Vec::new());
        }
        self.asked = Instant::now();
        let (bytes_before, bad_frames) = (self.bytes, self.bad_frames);
        let mut attempts = 0;
        for (attempt, wait) in waits.iter().enumerate() {
            if attempt > 0 && self.last_wait().is_some_and(|until| Instant::now() >= until) {
                break;
            }
            attempts += 1;
            // Before the last attempt: another program may have changed the port's settings.
            if attempt > 0 && attempt + 1 == waits.len() {
                self.renew(during)?;
            }
            // One write, so that an emulated board receives them together.
            let open = asked.iter().filter(|one| one.answer.is_none());
            let bytes: Vec<u8> = open.flat_map(|one| one.bytes.iter().copied()).collect();
            self.send(&bytes, *wait, during)?;
            let until = Instant::now() + *wait;
            while let Some(packet) = self.receive(until, during)? {
                match packet.header.kind {
                    Kind::Event | Kind::Log => on_other(&packet)?,
                    // Queue full: repeat later.
                    Kind::Error if is_queue_full(&packet) => {}
                    Kind::Response | Kind::Error => {
                        // Otherwise it is a late answer to an earlier request.
                        if let Some(one) = asked.iter_mut().find(|one| one.id == packet.header.id) {
                            one.answer = Some(packet);
                        }
                        let answers = asked.iter().map(|one| Some((one.id, one.answer.clone()?)));
                        if let Some(answers) = answers.collect() {
                            return Ok(answers);
                        }
                    }
                    Kind::Request => {}
                }
            }
        }
        Err(ClientError::Silent {
            port: self.port.clone(),
            during: during.into(),
            attempts,
            waited: self.asked.elapsed(),
            bad_frames: self.bad_frames - bad_frames,
            bytes: self.bytes - bytes_before,
        })
    }

    /// The next valid frame before `until`. Reads at least once, because the thread may be scheduled late.
    pub(crate) fn receive(&mut self, until: Instant, during: &str) -> Result<Option<Packet>, ClientError> {
        let mut looked = false;
        loop {
            for at in self.unread.by_ref() {
                match self.decoder.push(self.buffer[at]) {
                    Some(Ok(packet)) => return Ok(Some(packet)),
                    Some(Err(_)) => self.bad_frames += 1,
                    None => {}
                }
            }
            let last = self.last_wait();
            if last.is_some() && !self.open {
                return Err(ClientError::Interrupted { during: during.into(), stopped: false });
            }
            let until = last.map_or(until, |last| until.min(last));
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() && looked {
                return Ok(None);
            }
            looked = true;
            let slice = if self.interrupt.is_some() { left.min(SLICE) } else { left };
            let received = match &mut self.transport {
                Some(transport) => transport.receive(&mut self.buffer, slice),
                None => Err(ErrorKind::NotConnected.into()),
            };
            match received {
                Ok(count) => {
                    self.bytes += count as u64;
                    self.unread = 0..count;
                }
                Err(source) => return Err(self.gone(source, during)),
            }
        }
    }

    /// Reads until the line is silent, so that no answer for an earlier program is accepted.
    pub(crate) fn drain(&mut self, during: &str) -> Result<(), ClientError> {
        let drained = match &mut self.transport {
            Some(transport) => until_quiet(transport.as_mut(), &mut self.buffer),
            None => Err(ErrorKind::NotConnected.into()),
        };
        drained.map_err(|source| self.gone(source, during))?;
        self.unread = 0..0;
        self.decoder = Decoder::new();
        Ok(())
    }

    fn send(&mut self, bytes: &[u8], wait: Duration, during: &str) -> Result<(), ClientError> {
        let sent = match &mut self.transport {
            Some(transport) => transport.send(bytes, wait.max(SEND_AT_LEAST)),
            None => Err(ErrorKind::NotConnected.into()),
        };
        match sent {
            // No reader for the bytes; the missing answer reports it.
            Err(error) if error.kind() == ErrorKind::TimedOut => Ok(()),
            result => result.map_err(|source| self.gone(source, during)),
        }
    }

    fn gone(&self, source: io::Error, during: &str) -> ClientError {
        ClientError::Gone { port: self.port.clone(), during: during.into(), source: Arc::new(source) }
    }
}

#[cfg(test)]
mod tests {
    use farnear_protocol::PROTOCOL_CURRENT;

    use super::*;

    struct Silent;

    impl Transport for Silent {
        fn receive(&mut self, _: &mut [u8], wait: Duration) -> io::Result<usize> {
            std::thread::sleep(wait);
            Ok(0)
        }

        fn send(&mut self, _: &[u8], _: Duration) -> io::Result<()> {
            Ok(())
        }

        fn discard_input(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn an_interruption_shortens_the_wait_for_an_answer() {
        let flag = Arc::new(AtomicBool::new(false));
        let mut link = Link::new(Box::new(Silent), "port");
        link.interrupt_by(Some(Arc::clone(&flag)));
        link.opened();
        let setter = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            flag.store(true, Ordering::Relaxed);
        });
        let waits = [Duration::from_secs(30); 3];
        let asked = link.ask((PROTOCOL_CURRENT, 0), &Request::Stop, &waits, "stopping", &mut |_| Ok(()));
        let Err(ClientError::Silent { attempts, waited, .. }) = asked else { panic!("{asked:?}") };
        assert!(attempts == 1 && waited < Duration::from_secs(20), "{attempts} in {waited:?}");
        setter.join().unwrap();
    }
}
